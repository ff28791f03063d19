"""What hover losses leave, in one report: thrusts, reserves, critical losses; as numbers and as text."""

from __future__ import annotations

import math
from typing import NamedTuple

from rotorfault.analysis.hover import HoverMargin, critical_loss, hover_margin, numbers_of, torque_reserve
from rotorfault.base.text_table import table_lines
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.vehicle import Vehicle


class Attainable(NamedTuple):
    """What hover in still air is possible with given losses; `TrimReport.attainable`."""

    loss: PerRotor
    margin: HoverMargin
    reserve_with_yaw: Vec3  # N m about the body axes
    reserve_without_yaw: Vec3  # N m, z is 0
    critical_with_yaw: PerRotor  # largest loss of each rotor, the others as they are; NaN if there is none
    critical_without_yaw: PerRotor


def attainable(vehicle: Vehicle, loss: PerRotor | None = None) -> Attainable:
    """What hover in still air losses leave, and which further loss of a rotor would end it.

    Parameters
    ----------
    vehicle : Vehicle
    loss : PerRotor, optional
        Of each rotor, 0 to 1; all sound if not given.

    Returns
    -------
    Attainable
    """
    loss = PerRotor.all(0.0, vehicle.rotors) if loss is None else loss
    with_yaw, without_yaw = (
        PerRotor.of(critical_loss(vehicle, rotor, yaw, loss=loss) for rotor in numbers_of(vehicle))
        for yaw in (True, False)
    )
    return Attainable(
        loss=loss,
        margin=hover_margin(vehicle, loss),
        reserve_with_yaw=torque_reserve(vehicle, loss),
        reserve_without_yaw=torque_reserve(vehicle, loss, yaw=False),
        critical_with_yaw=with_yaw,
        critical_without_yaw=without_yaw,
    )


def attainable_lines(report: Attainable, vehicle: Vehicle) -> list[str]:
    """The same as text, within 100 columns.

    Parameters
    ----------
    report : Attainable
    vehicle : Vehicle
        The one that the report is about.

    Returns
    -------
    list of str
    """
    m = report.margin
    lost = [f"rotor {i} lost {x:g}" for i, x in enumerate(report.loss, start=1) if x > 0.0]
    kinds = [("", "possible", "largest thrust [N]", "torque in reserve about roll, pitch, yaw [N m]")]
    for name, possible, most, reserve in (
        ("yaw held", m.with_yaw, m.thrust_with_yaw, list(report.reserve_with_yaw)),
        ("yaw given up", m.without_yaw, m.thrust_without_yaw, list(report.reserve_without_yaw)[:2]),
    ):
        torque = ", ".join(f"{t:.3g}" for t in reserve) if possible else "-"
        kinds.append((name, "yes" if possible else "no", _thrust(most), torque))
    enough = "enough thrust on average, which is all that is known" if m.spinning else "-"
    kinds.append(("spinning", "perhaps" if m.spinning else "no", _thrust(m.thrust_spinning), enough))
    numbers = [str(number) for number in numbers_of(vehicle)]
    critical: list[tuple[str, ...]] = [("largest loss of one rotor, the others as they are", *numbers)]
    for name, losses in (("yaw held", report.critical_with_yaw), ("yaw given up", report.critical_without_yaw)):
        critical.append((name, *("none" if math.isnan(x) else f"{x:.4f}" for x in losses)))
    turn = f"which turns the body faster by {m.yaw_torque / vehicle.inertia.z:.3g} rad/s^2"
    left_over = [f"  yaw torque left over  {m.yaw_torque:.3g} N m, {turn}"]
    return [
        f"Attainable hover in still air, {', '.join(lost) or 'rotors sound'} (thrust needed {m.needed:.4g} N)",
        *table_lines(kinds, "<<><", indent=2),
        *(left_over if m.without_yaw and not m.with_yaw else []),
        *table_lines(critical, "<" + ">" * len(numbers), indent=2),
    ]


def _thrust(most: float) -> str:
    return f"{most:.4g}" if most > -math.inf else "no balance"
