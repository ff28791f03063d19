r"""Position, magnetic field, height by pressure, rotor speeds, flow and range: devices with white noise and a delay.

Flow is what a camera sees that looks down from the height :math:`d` along its own axis: the ground moves backwards by
:math:`v_x/d - \omega_y` and :math:`v_y/d + \omega_x` in rad/s, its own rotation included.
"""

from __future__ import annotations

from typing import Any, final

from rotorfault.maths.geometry import PerRotor, Vec3, zeros
from rotorfault.maths.rotation import Quat
from rotorfault.maths.scalar import Scalar, greater, less, reciprocal
from rotorfault.model.block import Context
from rotorfault.model.sensor_model import SensorNoise, Timing
from rotorfault.model.signals import Flow, Reading
from rotorfault.model.vehicle import MOST_ROTORS
from rotorfault.plant.devices import ErrorParameters, Given, Simple, wandering
from rotorfault.plant.sensors import SensorInputs

UPRIGHT = 0.5  # cosine of the tilt beyond which a sensor that looks down sees no ground
LOWEST = 0.05  # m: nearer, flow sees nothing sharp
_ONCE = Timing(0)


@final
class Fix(Simple):
    """Position, and velocity or attitude beside it, of one source such as motion capture or a satellite receiver."""

    def __init__(self, settings: Any) -> None:
        super().__init__(settings)
        fields = type(settings).model_fields
        # Which of them it gives is a choice of structure, by the settings that it has.
        self.velocity, self.attitude = "velocity_noise" in fields, "attitude_noise" in fields
        self.wanders = "wander" in fields
        self.first_normals = 3 + 3 * self.velocity + 3 * self.attitude
        self.normals = self.first_normals + 3 * self.wanders

    def parameters(self, context: Context) -> ErrorParameters:
        """Standard deviations, and the slow error's factor."""
        s = self.settings
        wander = wandering(s.wander, s.wander_time, context.period) if self.wanders else (0.0, 0.0)
        std = (s.position_noise, getattr(s, "velocity_noise", 0.0), getattr(s, "attitude_noise", 0.0))
        return ErrorParameters(std, wander, self.timing(context.period))

    def no_wander(self) -> Any:
        """None yet: the position counts from where the flight began."""
        return zeros() if self.wanders else ()

    def next_wander(self, wander: Any, inputs: SensorInputs, p: ErrorParameters) -> Any:
        """One step of the process."""
        if not self.wanders:
            return wander
        factor, gain = p.wander
        return wander * factor + Vec3.of(inputs.normals[self.first_normals : self.normals]) * gain

    def truth(self, inputs: SensorInputs, p: ErrorParameters, wander: Any) -> Any:
        """Position, velocity and attitude as far as it gives them."""
        state, n = inputs.state, inputs.normals
        position, velocity, attitude = p.std
        measured = state.p_W + Vec3.of(n[0:3]) * position
        values: list[Any] = [measured + wander if isinstance(wander, Vec3) else measured]
        if self.velocity:
            values.append(state.v_W + Vec3.of(n[3:6]) * velocity)
        if self.attitude:
            own = 3 + 3 * self.velocity
            values.append(state.q_WB @ Quat.small(Vec3.of(n[own : own + 3]) * attitude))
        return tuple(values)

    def given(self, reading: Reading[Any], inputs: SensorInputs, p: ErrorParameters) -> Given:
        """All at once."""
        names = ["position"] + ["velocity"] * self.velocity + ["attitude"] * self.attitude
        return {name: reading._replace(value=value) for name, value in zip(names, reading.value, strict=True)}

    def model(self, context: Context) -> Given:
        """As the data sheet has it."""
        s, timing = self.settings, self.timing(context.period)
        wander = {"wander": s.wander, "wander_time": s.wander_time} if self.wanders else {}
        model: Given = {"position": SensorNoise(s.position_noise, timing, **wander)}
        if self.velocity:
            model["velocity"] = SensorNoise(s.velocity_noise, timing)
        if self.attitude:
            model["attitude"] = SensorNoise(s.attitude_noise, timing)
        return model


@final
class Magnetometer(Simple):
    """The magnetic field of the place, in the body's axes."""

    normals = first_normals = 3

    def parameters(self, context: Context) -> ErrorParameters:
        """Standard deviation, and the field."""
        s = self.settings
        return ErrorParameters((s.noise,), (0.0, 0.0), self.timing(context.period), Vec3.of(s.field))

    def truth(self, inputs: SensorInputs, p: ErrorParameters, wander: Any) -> Any:
        """The field with noise."""
        field_W: Vec3 = p.extra
        return inputs.state.q_WB.matrix().T @ field_W + Vec3.of(inputs.normals) * p.std[0]

    def given(self, reading: Reading[Any], inputs: SensorInputs, p: ErrorParameters) -> Given:
        """The field."""
        return {"magnetic_field": reading}

    def model(self, context: Context) -> Given:
        """As the data sheet has it; the field of the place is known from a map."""
        s = self.settings
        return {
            "magnetic_field": SensorNoise(s.noise, self.timing(context.period)),
            "field_W": Vec3.of(s.field),
        }


@final
class Barometer(Simple):
    """Height by the pressure of the air."""

    normals = 2
    first_normals = 1

    def parameters(self, context: Context) -> ErrorParameters:
        """Standard deviation, and the slow error's factor."""
        s = self.settings
        wander = wandering(s.wander, s.wander_time, context.period)
        return ErrorParameters((s.noise,), wander, self.timing(context.period))

    def no_wander(self) -> Any:
        """None yet: heights count from the start."""
        return 0.0

    def next_wander(self, wander: Any, inputs: SensorInputs, p: ErrorParameters) -> Any:
        """One step of the process."""
        return wander * p.wander[0] + inputs.normals[1] * p.wander[1]

    def truth(self, inputs: SensorInputs, p: ErrorParameters, wander: Any) -> Any:
        """The height with both errors."""
        return inputs.state.p_W.z + wander + inputs.normals[0] * p.std[0]

    def given(self, reading: Reading[Any], inputs: SensorInputs, p: ErrorParameters) -> Given:
        """The height."""
        return {"pressure_altitude": reading}

    def model(self, context: Context) -> Given:
        """As the data sheet has it."""
        s = self.settings
        noise = SensorNoise(s.noise, self.timing(context.period), wander=s.wander, wander_time=s.wander_time)
        return {"pressure_altitude": noise}


@final
class Tachometer(Simple):
    """Speeds of the rotors, as speed controllers report them; none unless it is on."""

    def __init__(self, settings: Any) -> None:
        super().__init__(settings)
        self.normals = self.first_normals = MOST_ROTORS if settings.on else 0

    def parameters(self, context: Context) -> ErrorParameters:
        """Standard deviation."""
        return ErrorParameters((self.settings.noise,), (0.0, 0.0), self.timing(context.period))

    def truth(self, inputs: SensorInputs, p: ErrorParameters, wander: Any) -> Any:
        """Each speed with noise."""
        if not (self.settings.on and isinstance(inputs.rotor_speed, PerRotor)):
            return ()
        noise = PerRotor.of(inputs.normals[: len(inputs.rotor_speed)])
        return inputs.rotor_speed + noise * p.std[0]

    def given(self, reading: Reading[Any], inputs: SensorInputs, p: ErrorParameters) -> Given:
        """The speeds."""
        return {"rotor_speeds": reading} if self.settings.on else {}

    def model(self, context: Context) -> Given:
        """As measured on speed controllers."""
        s = self.settings
        return {"rotor_speeds": SensorNoise(s.noise, self.timing(context.period))} if s.on else {}


def _distance(inputs: SensorInputs) -> tuple[Scalar, Scalar]:
    """Distance in m to the ground along -z of the body, and whether it looks at the ground at all."""
    upright = inputs.state.q_WB.z_axis().z
    sees = greater(upright, UPRIGHT)
    return (inputs.state.p_W.z - inputs.ground) * reciprocal(upright * sees + (1.0 - sees)), sees


@final
class FlowCamera(Simple):
    """How the ground moves below."""

    normals = first_normals = 2

    def parameters(self, context: Context) -> ErrorParameters:
        """Standard deviation, and the largest flow that it can follow."""
        s = self.settings
        return ErrorParameters((s.noise,), (0.0, 0.0), self.timing(context.period), s.largest)

    def truth(self, inputs: SensorInputs, p: ErrorParameters, wander: Any) -> Any:
        """Both components, and whether it sees something."""
        state, n = inputs.state, inputs.normals
        distance, sees = _distance(inputs)
        near = less(distance, LOWEST)
        over = reciprocal(distance * (1.0 - near) + near)
        v_B = state.q_WB.matrix().T @ state.v_W
        x, y = v_B.x * over - state.omega_B.y, v_B.y * over + state.omega_B.x
        in_range = less(x * x, p.extra * p.extra) * less(y * y, p.extra * p.extra)
        return Flow(x + n[0] * p.std[0], y + n[1] * p.std[0]), sees * in_range * (1.0 - near)

    def given(self, reading: Reading[Any], inputs: SensorInputs, p: ErrorParameters) -> Given:
        """The flow, valid where the ground was seen."""
        flow, seen = reading.value
        return {"flow": reading._replace(value=flow, valid=reading.valid * seen)}

    def model(self, context: Context) -> Given:
        """As the firmware has it."""
        s = self.settings
        return {"flow": SensorNoise(s.noise, self.timing(context.period), limit=s.largest)}


@final
class RangeFinder(Simple):
    """Distance to the ground along -z of the body."""

    normals = first_normals = 1

    def parameters(self, context: Context) -> ErrorParameters:
        """Standard deviation and range."""
        s = self.settings
        return ErrorParameters((s.noise,), (0.0, 0.0), self.timing(context.period), s.farthest)

    def truth(self, inputs: SensorInputs, p: ErrorParameters, wander: Any) -> Any:
        """The distance, and whether it is within the range."""
        distance, sees = _distance(inputs)
        return distance + inputs.normals[0] * p.std[0], sees * less(distance, p.extra) * greater(distance, 0.0)

    def given(self, reading: Reading[Any], inputs: SensorInputs, p: ErrorParameters) -> Given:
        """The distance, valid within the range."""
        distance, seen = reading.value
        return {"range": reading._replace(value=distance, valid=reading.valid * seen)}

    def model(self, context: Context) -> Given:
        """As the firmware has it."""
        s = self.settings
        return {"range": SensorNoise(s.noise, self.timing(context.period), limit=s.farthest)}


@final
class Mark(Simple):
    """What is known at the start alone: how the vehicle is turned and, on a mark on the floor, where it stands."""

    normals = 0
    first_normals = 6

    def __init__(self, settings: Any) -> None:
        super().__init__(settings)
        self.placed = "position" in type(settings).model_fields

    def off_grid(self, name: str, period: float) -> None:
        """It is read once."""

    def parameters(self, context: Context) -> ErrorParameters:
        """Standard deviations."""
        s = self.settings
        return ErrorParameters((s.position if self.placed else 0.0, s.attitude), (0.0, 0.0), _ONCE)

    def truth(self, inputs: SensorInputs, p: ErrorParameters, wander: Any) -> Any:
        """Position and attitude."""
        n = inputs.normals if inputs.normals else (0.0,) * 6  # after the start nothing of it is used
        position = inputs.state.p_W + Vec3.of(n[0:3]) * p.std[0]
        return position, inputs.state.q_WB @ Quat.small(Vec3.of(n[3:6]) * p.std[1])

    def given(self, reading: Reading[Any], inputs: SensorInputs, p: ErrorParameters) -> Given:
        """Valid at the first instant alone."""
        position, attitude = reading.value
        given: Given = {"attitude": reading._replace(value=attitude)}
        return given | ({"position": reading._replace(value=position)} if self.placed else {})

    def model(self, context: Context) -> Given:
        """As well as it is known."""
        s = self.settings
        model: Given = {"attitude": SensorNoise(s.attitude, _ONCE)}
        return model | ({"position": SensorNoise(s.position, _ONCE)} if self.placed else {})
