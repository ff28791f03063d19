"""A Crazyflie in the manner of RotorPy's parameter files, with RotorPy 3.0.0's numbers for it."""

import numpy as np

arm = 0.043  # m

quad_params = {
    "mass": 0.03,  # kg
    "Ixx": 1.43e-5,  # kg m^2
    "Iyy": 1.43e-5,
    "Izz": 2.89e-5,
    "num_rotors": 4,
    "rotor_pos": {  # m, forward, left, up
        "r1": arm * np.array([0.70710678, 0.70710678, 0.0]),
        "r2": arm * np.array([0.70710678, -0.70710678, 0.0]),
        "r3": arm * np.array([-0.70710678, -0.70710678, 0.0]),
        "r4": arm * np.array([-0.70710678, 0.70710678, 0.0]),
    },
    "rotor_directions": np.array([1, -1, 1, -1]),  # of the yaw torque
    "k_eta": 2.3e-8,  # N/(rad/s)^2
    "k_m": 7.8e-10,  # N m/(rad/s)^2
    "k_d": 1.02506e-6,  # kg/rad
    "k_z": 7.553e-7,  # kg/rad
    "tau_m": 0.072,  # s
    "rotor_speed_min": 0.0,  # rad/s
    "rotor_speed_max": 2500.0,
}
