"""Can a slow ramp of a loss be told from a centre of mass, wind and mass that walk? The bound of any detector.

    python benchmarks/ramp_bound.py [--vehicles hummingbird ...] [--loss 0.1] [--time 10]

A rotor loses a share evenly over a time, in calm hover, 1.5 s after the start. What the innovations of the filter of
`glr` and `multiple_model` say of it is all that can be known under its model: the spreads at the start and the walks
of what is not known. For a ramp of the slope s the innovations have the mean s g(t); with their variances S the
slope stands out by s sqrt(sum g^2/S) standard deviations, for who knows rotor and onset. Beside it a constant loss
since the onset, as windows of that age would look for it, beyond the `least` of 3 %; and the same 2 s after each
onset, as old as the windows grow.
"""

from __future__ import annotations

import argparse

import numpy as np

from rotorfault.analysis.isolation import SETTLED, after_a_period, errors_after, hover
from rotorfault.analysis.vehicle_settings import numbers_of_vehicle
from rotorfault.autopilot.diagnosis.glr import Glr, GlrSettings
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorModel, SensorNoise

PERIOD = 0.001  # s
NOISE = SensorModel(rates=SensorNoise(0.002), specific_force=SensorNoise(0.05))


def bound(vehicle: str, loss: float, time: float) -> tuple[float, float, float]:
    """Standard deviations by which the least visible rotor's ramp stands out at its end.

    Returns
    -------
    tuple of float
        Of a ramp; of a constant loss since the onset beyond ``least``; of the same since 2 s before the end.
    """
    context = Context(numbers_of_vehicle(vehicle), PERIOD, NOISE)
    detector = Glr(GlrSettings())
    parameters = detector.parameters(context)
    model, least = hover(context, parameters), float(parameters.least)
    P, rotors, n = model.start, len(model.torque), len(model.start)
    ramp, constant, late = (np.zeros((rotors, n)) for _ in range(3))
    steps, windows = round(time / PERIOD), round(2.0 / PERIOD)
    slope, sums = np.zeros(rotors), {name: np.zeros((2, rotors)) for name in ("constant", "late")}
    for k in range(1, round(SETTLED / PERIOD) + steps + 1):
        P, variance, gain = after_a_period(P, model)
        since = k - round(SETTLED / PERIOD)
        if since <= 0:
            continue
        share = since / steps
        grown = model._replace(torque=model.torque * share, force=model.force * share)
        ramp, shown = errors_after(ramp, grown, gain)
        slope += (shown * shown / variance).sum(axis=1)
        constant, own = errors_after(constant, model, gain)
        sums["constant"] += np.array([(own * shown / variance).sum(axis=1), (own * own / variance).sum(axis=1)])
        if since > steps - windows:
            late, own = errors_after(late, model, gain)
            sums["late"] += np.array([(own * shown / variance).sum(axis=1), (own * own / variance).sum(axis=1)])
    found = [loss * np.sqrt(slope)]
    found += [(loss * d / np.maximum(C, 1e-12) - least) * np.sqrt(C) for d, C in sums.values()]
    best, constant_z, late_z = (float(z.min()) for z in found)
    return best, constant_z, late_z


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vehicles", nargs="+", default=["hummingbird", "crazyflie-2.1", "x500", "du-ppnnpn"])
    parser.add_argument("--loss", type=float, default=0.1)
    parser.add_argument("--time", type=float, default=10.0, help="over which it is lost [s]")
    chosen = parser.parse_args()
    print("vehicle          ramp    constant since onset    constant for 2 s   [standard deviations]")
    for vehicle in chosen.vehicles:
        best, constant, late = bound(vehicle, chosen.loss, chosen.time)
        print(f"{vehicle:14s} {best:6.1f} {constant:23.1f} {late:19.1f}", flush=True)


if __name__ == "__main__":
    main()
