"""What about a flight is hardly meant: said in a line each before it is flown, and of its commands afterwards."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

from rotorfault.analysis.hover import critical_loss, hover_margin
from rotorfault.analysis.sampling_check import sampled_data_warnings
from rotorfault.autopilot.allocation import ALLOCATION
from rotorfault.autopilot.allocation.dither import free_directions
from rotorfault.autopilot.control import CONTROLLER
from rotorfault.autopilot.presets import presets, record
from rotorfault.base.errors import (
    ControllerWarning,
    FaultWarning,
    InputError,
    ReferenceWarning,
    SensorWarning,
    StartWarning,
    VehicleWarning,
    WindWarning,
)
from rotorfault.flight.reference_rows import unflown
from rotorfault.flight.sensing_lines import sensing_lines
from rotorfault.flight.wind_lines import wind_lines
from rotorfault.loop.scores import RATTLING
from rotorfault.maths.geometry import PerRotor
from rotorfault.model.block import Context
from rotorfault.model.motion import mean_bandwidth
from rotorfault.model.vehicle_check import vehicle_warnings
from rotorfault.model.vehicle_file import VehicleFile
from rotorfault.plant import FAULT
from rotorfault.scenario.part import NO_PRESET, Part
from rotorfault.scenario.preset_file import is_preset_file, record_in_file
from rotorfault.scenario.scenario import Scenario
from rotorfault.scenario.vehicle_lines import vehicle_lines

# Share of the rotor bandwidth that a preset was made for: within it the detection was judged too, and beyond it the
# lag is no longer what the gains were searched against (a quarter either way).
FITS = (0.7, 1.4)


class Doubt(NamedTuple):
    """One thing that is hardly meant."""

    kind: type[UserWarning]
    says: str


def warn(scenario: Scenario, own_controller: bool = False, varied: bool = False, stacklevel: int = 2) -> None:
    """Warn of each of `doubts`.

    Parameters
    ----------
    scenario : Scenario
    own_controller, varied : bool
        See `doubts`.
    stacklevel : int
        Of the function that calls this one, whose caller the warning is for: 2.
    """
    for doubt in doubts(scenario, own_controller, varied):
        warnings.warn(doubt.says, doubt.kind, stacklevel=stacklevel + 1)


def doubts(scenario: Scenario, own_controller: bool = False, varied: bool = False) -> list[Doubt]:
    """What about vehicle, faults, controller, reference and wind is hardly meant; empty if nothing is.

    Parameters
    ----------
    scenario : Scenario
    own_controller : bool
        Whether a controller flies that the scenario does not name, and of which nothing is known.
    varied : bool
        Whether many flights differ in what the scenario holds: then faults, reference and wind are as they are meant.
    """
    found = [Doubt(VehicleWarning, line) for line in (*vehicle_lines(scenario), *_nothing_free(scenario))]
    if not varied:
        found += [Doubt(StartWarning, line) for line in _inverted(scenario)]
        found += [Doubt(FaultWarning, line) for line in (*_late(scenario), *_unattainable(scenario))]
    if not own_controller:
        found += [Doubt(ControllerWarning, line) for line in (*sampled_data_warnings(scenario), *_preset(scenario))]
    if not varied:
        found += [Doubt(ReferenceWarning, line) for line in unflown(scenario)]
        found += [Doubt(WindWarning, line) for line in wind_lines(scenario)]
        found += [Doubt(SensorWarning, line) for line in sensing_lines(scenario)]
    return found


def _nothing_free(scenario: Scenario) -> Iterator[str]:
    """A line where thrusts are to move that the vehicle has not got to spare."""
    vehicle = scenario.vehicle.vehicle
    if scenario[ALLOCATION].kind == "dither" and not free_directions(vehicle).shape[1]:
        yield (
            f"allocation 'dither': the {vehicle.rotors} rotors of '{scenario.vehicle.name}' leave no thrusts free, "
            "so nothing is moved and it is 'effectiveness'; vehicles with more rotors than forces and torques, as "
            "octa-x, have some"
        )


def rattling(scores: Mapping[str, Any], controller: str) -> Doubt | None:
    """Commands that change by more from one sampling period to the next than motors should be asked for.

    Parameters
    ----------
    scores : mapping
        Of the flight.
    controller : str
        Its label.
    """
    step = scores["command_step"]
    if not step > RATTLING:
        return None
    return Doubt(
        ControllerWarning,
        f"{controller} rattles: commands change by {100.0 * step:.2g} % of hover thrust each sampling period, on "
        f"average; up to {100.0 * RATTLING:g} % is usual; try a wider boundary layer, a slower preset or "
        "'rotorfault tune --objective quiet'",
    )


def _inverted(scenario: Scenario) -> Iterator[str]:
    """A start upside down: few mean it, and 3 degrees, typed as such, are one."""
    if (found := scenario.start.inverted) is not None:
        tilt, meant = found
        yield f"start.attitude: {tilt}, so the flight begins upside down; {meant}"


def _late(scenario: Scenario) -> Iterator[str]:
    """Faults that the flight does not see."""
    for number, (fault, numbers) in enumerate(_faults(scenario)):
        if (onset := fault.onset(numbers)) >= scenario.duration:
            text = f"sets in at {onset:g} s, after the end of the flight at {scenario.duration:g} s"
            yield f"fault {number + 1} (key fault.{number}) {text}"


def _faults(scenario: Scenario) -> list[tuple[Any, Any]]:
    """Each fault with its numbers."""
    context = Context(scenario.mismatch.applied(scenario.vehicle), scenario.period)
    made = [part.make() for part in scenario.all(FAULT)]
    return [(fault, fault.parameters(context)) for fault in made]


def _unattainable(scenario: Scenario) -> Iterator[str]:
    """What the losses that remain for good leave of hover, if that is not all of it."""
    left = [1.0] * len(scenario.vehicle.rotor)
    for fault, numbers in _faults(scenario):
        loss = fault.final_loss(numbers)
        if loss is not None and fault.onset(numbers) < scenario.duration:
            left[fault.rotor - 1] *= 1.0 - float(loss)
    loss = PerRotor.of(1.0 - share for share in left)
    if not any(loss):
        return
    vehicle = scenario.mismatch.applied(scenario.vehicle)
    margin = hover_margin(vehicle, loss)
    if margin.with_yaw:
        return
    lost = " ".join(f"--loss {rotor}={value:.4g}" for rotor, value in enumerate(loss, 1) if value)
    if not margin.spinning:
        what = "there is not enough thrust left to stay in the air"
    elif not margin.without_yaw:
        what = "roll and pitch cannot be balanced: it can stay in the air only by spinning, if at all"
    else:
        what = "yaw cannot be held: at best it spins about its thrust axis and stays in place"
    hit = [rotor for rotor, value in enumerate(loss, 1) if value]
    if len(hit) == 1 and 0.0 < (most := float(critical_loss(vehicle, hit[0]))) < 1.0:
        what += f"; yaw can be held up to a loss of {most:.4g} of rotor {hit[0]}"
    yield (
        f"the faults lie outside the attainable set, whoever controls: {what}; "
        f"see 'rotorfault trim {scenario.vehicle.name} {lost}'"
    )


def _preset(scenario: Scenario) -> Iterator[str]:
    """Whether the controller's preset was made for other rotors, and what trim has to say of it then."""
    part = scenario[CONTROLLER]
    made = _made_for(part)
    bandwidth, vehicle = made.get("rotor_bandwidth"), scenario.vehicle
    if not isinstance(bandwidth, (int, float)) or not bandwidth > 0.0:
        return
    here = mean_bandwidth(vehicle.vehicle)
    if FITS[0] <= here / bandwidth <= FITS[1]:
        return
    fitting = [name for name in presets(part.kind) if _fits(record(part.kind, name), here)]
    advice = f"made for such rotors: {', '.join(fitting)}" if fitting else f"'rotorfault tune {part.kind}' makes one"
    yield (
        f"preset '{part.preset_label}' of {part.kind} was made for rotors of {bandwidth:g} rad/s "
        f"({made.get('vehicle', 'another vehicle')}); those of '{vehicle.name}' have {here:g}; {advice}"
    )
    if lines := _trim_warnings(vehicle.model_dump_json(), part, scenario.period):
        yield f"trim warns of this pair: {'; '.join(lines)}"


def _fits(made: Mapping[str, Any], bandwidth: float) -> bool:
    wanted = made.get("rotor_bandwidth", 0.0)
    return bool(wanted > 0.0 and FITS[0] <= bandwidth / wanted <= FITS[1])


def _made_for(part: Part[Any]) -> Mapping[str, Any]:
    """What the preset of a part says of what it was made for; empty where it says nothing."""
    if part.preset in ("", NO_PRESET):
        return {}
    if not is_preset_file(part.preset):
        return record(part.kind, part.preset)
    try:
        return record_in_file(part.preset)
    except InputError:
        return {}  # the file may be gone: a flight holds all settings itself


@lru_cache(maxsize=64)
def _trim_warnings(vehicle: str, part: Part[Any], period: float) -> tuple[str, ...]:
    """Warnings of `rotorfault trim` for a vehicle as JSON; they take a third of a second, so they are kept."""
    # Brings scipy, which takes longer to load than most flights take to fly.
    from rotorfault.analysis.trim import trim_report

    try:
        file = VehicleFile.model_validate_json(vehicle)
        said = vehicle_warnings(file.vehicle)  # which are told apart
        return tuple(line for line in trim_report(file, part.make(), period=period).warnings if line not in said)
    except InputError:
        return ()  # outside of what trim looks at
