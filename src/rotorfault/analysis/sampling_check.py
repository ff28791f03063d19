r"""Can a control law be flown at this sampling period and with these rotors? A cheap check of its gains, per axis.

Laws are designed in continuous time for ideal actuators, :math:`\ddot e = u = -k_1 e - k_2\dot e`; they fly sampled,
behind rotors that lag. For the gains that a controller reports (signals ``gain_position`` and others), the
nominal axis is therefore closed again through a zero-order hold and a first-order lag, exactly,

.. math:: \frac{d}{dt}\begin{pmatrix} e\\ \dot e\\ a\end{pmatrix} =
          \begin{pmatrix} \dot e\\ a\\ w_0(u_k - a)\end{pmatrix}, \qquad u_k = -k_1 e_k - k_2\dot e_k

and an axis is reported if a sampled pole z is outside the unit circle or its damping -Re(log z)/|log z| is below
`LEAST_DAMPING`. Source of the sampling: K. J. Astrom, B. Wittenmark, "Computer-Controlled Systems", 3rd ed., 1997,
section 3.2. A warning therefore proves that the nominal gains are too fast; the absence of a warning proves nothing:
x and y are taken to have the rotors' lag only, as if the attitude followed at once, and coupling, limits and
switching inputs are left out. `rotorfault.analysis.linearisation` has the whole loop in hover.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rotorfault.autopilot.allocation.available import thrust_available
from rotorfault.autopilot.control.protocol import CONTROLLER, ControlInputs, ControlOutput
from rotorfault.autopilot.prediction import Prediction
from rotorfault.maths.arrays import ANGLES, Complex
from rotorfault.maths.geometry import Vec3, zeros
from rotorfault.maths.records import flatten, unflatten
from rotorfault.maths.rotation import Quat
from rotorfault.model.block import Context
from rotorfault.model.mixer import hover_thrust
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.signals import Estimate, Reference, at_rest, healthy
from rotorfault.model.vehicle import Vehicle
from rotorfault.reference import REFERENCE
from rotorfault.scenario.scenario import Scenario

LEAST_DAMPING = 0.1  # our choice: below it an oscillation loses less than half of its height per cycle


class AxisGains(NamedTuple):
    """Nominal feedback u = -k1 e - k2 e_dot of one axis."""

    axis: str
    k1: float  # 1/s^2
    k2: float  # 1/s
    direct: bool = False  # acts at once, without rotors: x and y under the option `six_inputs`

    @property
    def nominal_pole(self) -> complex:
        """Fastest pole of the nominal loop in continuous time with an ideal actuator, rad/s."""
        return complex(max(np.roots([1.0, self.k2, self.k1]), key=abs))


def sampled_poles(gains: AxisGains, period: float, rotor_bandwidth: float) -> Complex:
    """Poles z of one nominal axis, sampled and behind its actuators.

    Parameters
    ----------
    gains : AxisGains
    period : float, s
    rotor_bandwidth : float, rad/s
    """
    T, w = period, rotor_bandwidth
    gap = -math.expm1(-w * T)  # 1 - exp(-w T)
    if gains.direct:
        held = np.array([[1.0, T], [0.0, 1.0]])
        entering = np.array([0.5 * T * T, T])
    else:
        first, second = gap / w, (T - gap / w) / w  # of the lag's own response, integrated once and twice
        held = np.array([[1.0, T, second], [0.0, 1.0, first], [0.0, 0.0, 1.0 - gap]])
        entering = np.array([0.5 * T * T - second, T - first, gap])
    K = np.array([gains.k1, gains.k2, 0.0][: len(held)])
    z: Complex = np.linalg.eigvals(held - np.outer(entering, K)).astype(np.complex128)
    return z


def damping(z: Complex) -> float:
    """Least damping of poles in the z plane: negative if one is outside the unit circle, 1 if all are real in (0, 1).

    Poles at zero do not count.
    """
    s = np.log(z[np.abs(z) > 1e-12])
    return float(np.min(-s.real / np.maximum(np.abs(s), 1e-300), initial=1.0))


def warning(gains: AxisGains, period: float, rotor_bandwidth: float, where: str) -> str | None:
    """What is wrong with one axis, in one line with numbers; None if nothing is."""
    if not (math.isfinite(gains.k1) and math.isfinite(gains.k2)):
        return f"{gains.axis} {where}: the controller's gains are not finite"
    z = sampled_poles(gains, period, rotor_bandwidth)
    least, p = damping(z), gains.nominal_pole
    if least >= LEAST_DAMPING:
        return None
    growth = math.log(max(abs(z))) / period
    verdict = f"unstable, growing with {growth:.3g} 1/s" if least < 0.0 else f"poorly damped, damping {least:.2g}"
    path = "" if gains.direct else f" behind rotors of {rotor_bandwidth:g} rad/s"
    pole = f"{p.real:.4g} rad/s" if abs(p.imag) < 1e-9 * abs(p) else f"{p.real:.4g} +- {abs(p.imag):.4g}j rad/s"
    return (
        f"{gains.axis} {where}: nominal pole {pole} (|p| T = {abs(p) * period:.2g}, |p| / w0 = "
        f"{abs(p) / rotor_bandwidth:.2g}); sampled every {period:g} s{path} the loop is {verdict}"
    )


def reported_gains(
    controller: Any, vehicle: Vehicle, period: float, estimate: Estimate, reference: Reference
) -> tuple[AxisGains, ...]:
    """Gains that a controller reports at its first step; an axis without any is left out.

    Of the attitude's gain matrices the diagonals are taken.
    """

    def first_step(seen: Estimate) -> tuple[ControlOutput, Any]:
        numbers = controller.parameters(Context(vehicle, period))
        sound, hover = healthy(vehicle.rotors), hover_thrust(vehicle)
        inputs = ControlInputs(
            estimate=seen,
            reference=reference,
            vehicle=vehicle,
            diagnosis=sound,
            command=hover / vehicle.rotor_gain,
            expected_thrust=hover,
            prediction=Prediction(zeros(), zeros()),
            residual_speed=0.0,
            thrust_available=thrust_available(vehicle, sound.loss),
        )
        output: ControlOutput
        _, output, telemetry = controller.step(controller.initial(inputs, numbers), inputs, numbers, period)
        return output, telemetry

    signals = first_step(estimate)[1]
    if not all(hasattr(signals, name) for name in ("gain_position", "gain_velocity", "gain_angle", "gain_rate")):
        return ()
    # Displaced sideways, only a controller with direct inputs commands an acceleration without rotors.
    aside = estimate._replace(p_W=reference.p_W + Vec3(0.1, 0.1, 0.0))
    direct = first_step(aside)[0].direct_acceleration_W
    rows = [
        *zip("xyz", signals.gain_position, signals.gain_velocity, direct, strict=True),
        *zip(ANGLES, signals.gain_angle.diag, signals.gain_rate.diag, zeros(), strict=True),
    ]
    return tuple(AxisGains(axis, k1, k2, d != 0.0) for axis, k1, k2, d in rows if (k1, k2) != (0.0, 0.0))


def sampled_data_check(
    controller: Any,
    vehicle: Vehicle,
    period: float,
    estimate: Estimate | None = None,
    reference: Reference | None = None,
) -> list[str]:
    """Warn where a controller's nominal loop is too fast for the sampling period or the rotors.

    Parameters
    ----------
    controller : Controller
        Any; one that reports no gains cannot be checked and gives no warning, nor one of the python engine only,
        which may keep state of its own that a trial step would change.
    vehicle : Vehicle
        As the autopilot believes it to be; the lag is the mean one of its rotors.
    period : float, s
    estimate, reference : optional
        Start of a flight, checked besides the hover at the target.

    Returns
    -------
    list of str
        One line per axis that cannot be flown well, with numbers; empty if there is none.
    """
    if getattr(controller, "python_only", False):
        return []
    zero = zeros()
    target = Reference(zero, zero, zero, 0.0, 0.0, 0.0)
    places = [("at the target", at_rest(vehicle.gravity), target)]
    if estimate is not None:
        places.append(("at the start", estimate, target if reference is None else reference))
    lines: dict[str, str] = {}
    for where, start, goal in places:
        try:
            reported = reported_gains(controller, vehicle, period, start, goal)
        except (ZeroDivisionError, OverflowError):
            return [f"{where}: the controller's gains are not finite; its settings are too extreme for doubles"]
        for gains in reported:
            line = warning(gains, period, mean_bandwidth(vehicle), where)
            if line is not None:
                lines.setdefault(gains.axis, line)
    return list(lines.values())


def sampled_data_warnings(scenario: Scenario, controller: Any = None) -> list[str]:
    """`sampled_data_check` of the flight that a scenario describes, at the target and at the start.

    Parameters
    ----------
    scenario : Scenario
    controller : Controller, optional
        Flies in place of the scenario's.
    """
    s, vehicle = scenario.start, scenario.vehicle.vehicle
    start = Estimate(
        p_W=Vec3.of(s.position),
        v_W=Vec3.of(s.velocity),
        q_WB=Quat.from_euler(Vec3.of(s.attitude)),
        omega_B=Vec3.of(s.body_rates),
        specific_force_B=Vec3(0.0, 0.0, vehicle.gravity),  # rotors start at hover thrust
    )
    with np.errstate(all="ignore"):  # numbers that are not finite are told of by the flight
        first = scenario[REFERENCE].make().table(np.zeros(1)).at(0)
    reference: Reference = unflatten(first, [float(leaf) for leaf in flatten(first)])
    return sampled_data_check(
        scenario[CONTROLLER].make() if controller is None else controller,
        vehicle,
        scenario.period,
        start,
        reference,
    )
