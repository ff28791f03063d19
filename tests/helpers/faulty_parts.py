"""Two parts that keep all rules of a part, and others with one fault each."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

import rotorfault as rf
from rotorfault.maths.scalar import Scalar, greater, select

CALM = rf.Air(rf.Vec3(0.0, 0.0, 0.0), rf.Vec3(0.0, 0.0, 0.0))


def blowing(speed: Scalar) -> rf.Air:
    return CALM._replace(velocity_W=rf.Vec3(speed, 0.0, 0.0))


class Speed(NamedTuple):
    speed: Scalar  # m/s


class SpeedSettings(rf.Settings):
    speed: float = Field(3.0, description="of the air [m/s]")


class Good(rf.Wind[rf.Nothing, Speed]):
    """Air that moves forward at a steady speed."""

    Settings = SpeedSettings

    def parameters(self, context: rf.Context) -> Speed:
        return Speed(self.settings.speed)

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed)


class Filtered(rf.Estimator[Any, Speed]):
    """The readings as they are, beside a number that decays."""

    Settings = SpeedSettings

    def parameters(self, context: rf.Context) -> Speed:
        return Speed(self.settings.speed)

    def initial(self, inputs: rf.EstimatorInputs, parameters: Speed) -> Any:
        return Speed(parameters.speed)

    def step(self, memory: Any, inputs: rf.EstimatorInputs, parameters: Speed, dt: Scalar) -> Any:
        position, velocity, attitude, rates, _ = (reading.value for reading in inputs.readings[:5])
        shifted = position + rf.Vec3(1e-6, 0.0, 0.0) * memory.speed
        return self.after(memory, parameters), rf.Estimate(shifted, velocity, attitude, rates), self.told(memory)

    def after(self, memory: Any, parameters: Speed) -> Any:
        return Speed(memory.speed * 0.9 + parameters.speed * 0.1)

    def told(self, memory: Any) -> Any:
        return rf.Nothing()


# ------------------------------------------------------------------------------------------------- parts with a fault


class BakedInStep(Good):
    """Air whose speed stands in its code."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(self.settings.speed)


class BakedInInitial(Filtered):
    """Readings, beside a number that begins with a setting."""

    def initial(self, inputs: rf.EstimatorInputs, parameters: Speed) -> Any:
        return Speed(self.settings.speed)


class Loss(NamedTuple):
    time: Scalar  # s
    loss: Scalar  # 1


class BakedOnset(rf.Fault[rf.Nothing, Loss]):
    """A loss of thrust that says of its settings when it begins."""

    class Settings(rf.OneRotor):
        time: float = Field(0.1, description="of the loss [s]")
        loss: float = Field(0.2, description="share of the thrust [-]")

    def parameters(self, context: rf.Context) -> Loss:
        return Loss(self.settings.time, self.settings.loss)

    def onset(self, parameters: Loss) -> Scalar:
        return self.settings.time

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Loss) -> rf.Effect:
        return rf.Effect(1.0 - select(greater(time, parameters.time), parameters.loss, 0.0))


class Idle(Good):
    """Air with a setting that does nothing."""

    class Settings(SpeedSettings):
        gust: float = Field(1.0, description="of nothing [m/s]")


class OwnState(Good):
    """Air that counts how often it was asked, from some time on."""

    def __init__(self, settings: Any) -> None:
        super().__init__(settings)
        self.asked = 0

    def step(self, memory: rf.Nothing, inputs: rf.TimeInputs, parameters: Speed, dt: Scalar) -> Any:
        self.asked += 1
        speed = parameters.speed * select(greater(inputs.time, 0.12), float(self.asked), 1.0)
        return memory, blowing(speed), rf.Nothing()


class Chooses(Good):
    """Air that chooses by the time."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed) if time > 0.1 else CALM


class Branches(Good):
    """Air that asks whether a condition holds."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed) if greater(time, 0.1) else CALM


class ChoosesAtFirst(Filtered):
    """Readings, beside a number that begins as the first reading says."""

    def initial(self, inputs: rf.EstimatorInputs, parameters: Speed) -> Any:
        position = inputs.readings.position
        assert isinstance(position, rf.Reading)
        return Speed(parameters.speed if position.value.x > 0.0 else 0.0)


class OwnFunctions(Good):
    """Air that turns by a function of another library."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed * math.sin(time))


class TellsFloats(Good):
    """Air that blows otherwise where numbers are no floats."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return blowing(parameters.speed if isinstance(parameters.speed, float) else parameters.speed * 1.001)


class Swallows(Filtered):
    """Readings, and zero where there is none."""

    def step(self, memory: Any, inputs: rf.EstimatorInputs, parameters: Speed, dt: Scalar) -> Any:
        position, velocity, attitude, rates, _ = (
            type(value)(*(select(greater(x, -1e9), x, 0.0) for x in value))
            for value in (reading.value for reading in inputs.readings[:5])
        )
        return memory, rf.Estimate(position, velocity, attitude, rates), rf.Nothing()


class Feathers(rf.Controller[rf.Nothing, rf.Nothing]):
    """Half of the weight, whatever is measured."""

    def step(self, memory: rf.Nothing, inputs: rf.ControlInputs, parameters: rf.Nothing, dt: Scalar) -> Any:
        # Commands of the rotors, for allocation passes on what is no number of the body's spin.
        each = 0.125 * inputs.vehicle.mass * inputs.vehicle.gravity
        return memory, rf.ControlOutput(rf.PerRotor.all(each)), rf.Nothing()


class Inner(rf.Settings):
    bare: int = 1


class BareSettings(Good):
    """Air with settings that nobody describes."""

    class Settings(SpeedSettings):
        more: tuple[Inner, Inner] = Field((Inner(), Inner()), description="settings of settings")
        name: str = "air"


class Silent(Good):
    pass


Silent.__doc__ = None


class NoUnits(Filtered):
    """Readings, with a signal without a unit."""

    class Telemetry(NamedTuple):
        decaying: Scalar


class Decaying(NamedTuple):
    decaying: Annotated[Scalar, rf.Quantity("m/s", "", "number that decays")]


class Unsaid(Filtered):
    """Readings, with a signal that its step does not return."""

    Telemetry = Decaying


class NotFinite(Filtered):
    """Readings, with a signal that is no number."""

    Telemetry = Decaying

    def told(self, memory: Any) -> Any:
        return Decaying(math.nan * memory.speed)


class Grows(Filtered):
    """Readings, beside a memory that grows."""

    def after(self, memory: Any, parameters: Speed) -> Any:
        return (*memory, parameters.speed)


class Explodes(Filtered):
    """Readings, beside a number that becomes infinite."""

    def step(self, memory: Any, inputs: rf.EstimatorInputs, parameters: Speed, dt: Scalar) -> Any:
        _, estimate, told = super().step(Speed(0.0), inputs, parameters, dt)
        return Speed(memory.speed * 1e10), estimate, told


class Falls(Good):
    """Air that stops in the middle of a flight."""

    def at(self, time: Scalar, memory: rf.Nothing, parameters: Speed) -> rf.Air:
        return {}["air"]  # type: ignore[no-any-return]


class Random(rf.ReferenceSource):
    """Another place each time it is asked."""

    def __init__(self, settings: Any = None) -> None:
        super().__init__(settings)
        self.random = np.random.default_rng(1)

    def table(self, times: Any) -> rf.ReferenceTable:
        zero, level = np.zeros((len(times), 3)), np.zeros_like(times)
        place = np.tile(self.random.uniform(0.0, 0.1, 3), (len(times), 1))
        return rf.ReferenceTable(place, zero, zero, level, level, level)


class UnsaidReference(Random):
    """A reference with a signal that it does not give."""

    Telemetry = Decaying
