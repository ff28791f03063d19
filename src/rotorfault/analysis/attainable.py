"""What `rotorfault trim` says of hover with given losses: possible or not, and which loss would end it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from rotorfault.analysis.hover import HoverMargin, critical_loss, hover_margin, torque_reserve
from rotorfault.base.errors import InputError
from rotorfault.maths.geometry import PerRotor, Vec3
from rotorfault.model.vehicle import Vehicle


class Attainable(NamedTuple):
    """What hover in still air is possible with given losses; see `rotorfault.analysis.hover`."""

    loss: PerRotor
    margin: HoverMargin
    reserve_with_yaw: Vec3  # N m about the body axes
    reserve_without_yaw: Vec3  # N m, z is 0
    critical_with_yaw: PerRotor  # largest loss of each rotor, the others as they are; NaN if there is none
    critical_without_yaw: PerRotor


def attainable(vehicle: Vehicle, loss: PerRotor | None = None) -> Attainable:
    """What hover in still air is possible with given losses of the rotors; all sound if not given."""
    loss = PerRotor.all(0.0) if loss is None else loss
    with_yaw, without_yaw = (
        PerRotor.of(critical_loss(vehicle, rotor, yaw, loss=loss) for rotor in (1, 2, 3, 4)) for yaw in (True, False)
    )
    return Attainable(
        loss=loss,
        margin=hover_margin(vehicle, loss),
        reserve_with_yaw=torque_reserve(vehicle, loss),
        reserve_without_yaw=torque_reserve(vehicle, loss, yaw=False),
        critical_with_yaw=with_yaw,
        critical_without_yaw=without_yaw,
    )


def parse_losses(pairs: Sequence[str]) -> PerRotor:
    """Losses of the rotors from ``R=VALUE`` texts, 0 for rotors that are not named.

    Raises
    ------
    InputError
        If a text is no such pair, there is no such rotor, a value is not in 0 to 1, or a rotor comes twice.
    """
    losses: dict[str, float] = {}
    for pair in pairs:
        rotor, _, text = (part.strip() for part in pair.partition("="))
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if rotor not in ("1", "2", "3", "4") or not 0.0 <= value <= 1.0:
            raise InputError(f"--loss {pair}: allowed: R=VALUE with rotor 1 to 4 and loss 0 to 1, such as 1=0.4")
        if rotor in losses:
            raise InputError(f"--loss {pair}: rotor {rotor} has a loss already; allowed: one for each rotor")
        losses[rotor] = value
    return PerRotor.of(losses.get(rotor, 0.0) for rotor in ("1", "2", "3", "4"))


def attainable_lines(report: Attainable, vehicle: Vehicle) -> list[str]:
    """The same as text, within 100 columns."""
    m = report.margin
    lost = [f"rotor {i} lost {x:g}" for i, x in enumerate(report.loss, start=1) if x > 0.0]
    lines = [
        f"Attainable hover in still air, {', '.join(lost) or 'rotors sound'} (thrust needed {m.needed:.4g} N)",
        f"  {'':12}  possible  {'largest thrust [N]':>18}  torque in reserve about roll, pitch, yaw [N m]",
    ]
    for name, possible, most, reserve in (
        ("yaw held", m.with_yaw, m.thrust_with_yaw, list(report.reserve_with_yaw)),
        ("yaw given up", m.without_yaw, m.thrust_without_yaw, list(report.reserve_without_yaw)[:2]),
    ):
        torque = ", ".join(f"{t:.3g}" for t in reserve) if possible else "-"
        lines.append(f"  {name:12}  {'yes' if possible else 'no':8}  {_thrust(most):>18}  {torque}")
    enough = "enough thrust on average, which is all that is known" if m.spinning else "-"
    lines.append(
        f"  {'spinning':12}  {'perhaps' if m.spinning else 'no':8}  {_thrust(m.thrust_spinning):>18}  {enough}"
    )
    if m.without_yaw and not m.with_yaw:
        turn = m.yaw_torque / vehicle.inertia.z
        lines.append(
            f"  yaw torque left over    {m.yaw_torque:.3g} N m, which turns the body faster by {turn:.3g} rad/s^2"
        )
    rows = (("yaw held", report.critical_with_yaw), ("yaw given up", report.critical_without_yaw))
    lines.append(f"  largest loss of one rotor, the others as they are {'1':>8}{'2':>8}{'3':>8}{'4':>8}")
    for name, critical in rows:
        cells = "".join(f"{'none' if math.isnan(x) else format(x, '.4f'):>8}" for x in critical)
        lines.append(f"  {name:48}  {cells}")
    return lines


def _thrust(most: float) -> str:
    return f"{most:.4g}" if most > -math.inf else "no balance"
