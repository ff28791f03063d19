"""Sets of sensors by name, each number with its source.

`mocap` is a laboratory with motion capture, `gps-consumer` a consumer autopilot outdoors, `crazyflie` a Crazyflie 2.1
with its flow deck. What a set has is a choice of structure; its numbers are settings, and may differ between flights.
The gyro's range of 2,000 degrees per second is that of all these units.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, NamedTuple, final

from pydantic import Field

from rotorfault.base.angles import FASTEST_TURN, HALF_TURN, Radians
from rotorfault.base.config import Strict, Three
from rotorfault.maths.geometry import Vec3
from rotorfault.maths.records import record_type
from rotorfault.maths.scalar import Scalar
from rotorfault.model.block import Context, Record, TimeGrid
from rotorfault.model.sensor_model import SensorModel
from rotorfault.model.signals import Readings
from rotorfault.model.slot import register
from rotorfault.model.telemetry import BODY, Quantity
from rotorfault.plant.devices import Device, Imu, Timed
from rotorfault.plant.instruments import Barometer, Fix, FlowCamera, Magnetometer, Mark, RangeFinder, Tachometer
from rotorfault.plant.sensors import SensorInputs, Sensors

DEGREE, G = math.pi / 180.0, 9.80665
RotorS = "RotorS, gazebo_imu_plugin.h (Furrer and others 2016), after the ADIS16448"
ICM = "TDK ICM-42688-P, DS-000347"
BMI = "Bosch BMI088, BST-BMI088-DS001"
OURS = "our estimate"


def _number(value: float, what: str, source: str, **limits: Any) -> Any:
    """A setting with its source in its description."""
    return Field(float(f"{value:.8g}"), description=f"{what}; {source}", **(limits or {"ge": 0.0}))


def _group(kind: type[Strict]) -> Any:
    """A group of settings, as it is if none of them is given."""
    return Field(default=kind.model_validate({}), description=kind.__doc__)


Rate = Annotated[float, Radians(FASTEST_TURN, "rad/s")]
Angle = Annotated[float, Radians(HALF_TURN)]


class ImuSettings(Timed):
    """Gyro and accelerometer of a consumer autopilot."""

    gyro_noise: float = _number(
        0.0028 * DEGREE, "noise density of the gyro [rad/s/sqrt(Hz)]", f"{ICM}: 2.8 mdps/sqrt(Hz)"
    )
    gyro_bias: Rate = _number(
        0.5 * DEGREE, "standard deviation of its bias at the start [rad/s]", f"{RotorS}: 0.5 deg/s"
    )
    gyro_bias_walk: float = _number(
        3.8785e-5,
        "standard deviation that this bias gains in a second [rad/s/sqrt(s)]",
        f"{RotorS}: 2 x 4 deg/h/sqrt(h)",
    )
    gyro_range: float = _number(2000.0 * DEGREE, "end of its range [rad/s]", f"{ICM}: 2000 deg/s", gt=0.0)
    accelerometer_noise: float = _number(
        70e-6 * G, "noise density of the accelerometer [m/s^2/sqrt(Hz)]", f"{ICM}: 70 ug/sqrt(Hz)"
    )
    accelerometer_bias: float = _number(
        20e-3 * G, "standard deviation of its bias at the start [m/s^2]", f"{RotorS}: 20 mg"
    )
    accelerometer_bias_walk: float = _number(
        6e-3, "standard deviation that this bias gains in a second [m/s^2/sqrt(s)]", f"{RotorS}: 2 x 3e-3"
    )
    accelerometer_range: float = _number(16.0 * G, "end of its range [m/s^2]", f"{ICM}: 16 g", gt=0.0)
    place: Three = Field((0.0, 0.0, 0.0), description="of both from the centre of mass: forward, left, up [m]")
    gyro_vibration: float = _number(
        0.0, "amplitude of the vibration that rotors make on it, at hover [rad/s]", "none unless asked for"
    )
    accelerometer_vibration: float = _number(
        0.0, "amplitude of the vibration that rotors make on it, at hover [m/s^2]", "none unless asked for"
    )


class CrazyflieImu(ImuSettings):
    """Gyro and accelerometer of a Crazyflie 2.1."""

    gyro_noise: float = _number(
        0.014 * DEGREE, "noise density of the gyro [rad/s/sqrt(Hz)]", f"{BMI}: 0.014 deg/s/sqrt(Hz)"
    )
    accelerometer_noise: float = _number(
        175e-6 * G, "noise density of the accelerometer [m/s^2/sqrt(Hz)]", f"{BMI}: 175 ug/sqrt(Hz)"
    )
    accelerometer_range: float = _number(
        24.0 * G, "end of its range [m/s^2]", "crazyflie-firmware, sensors_bmi088_bmp3xx.c: 24 g", gt=0.0
    )


class MocapSettings(Timed):
    """Motion capture: position and attitude."""

    rate: int = Field(100, ge=1, description=f"measurements per second [Hz]; {OURS}: what a radio link carries")
    delay_ms: int = Field(
        10,
        ge=0,
        le=1000,
        description=f"from a measurement to its arrival [ms]; Qualisys at ETH: 6 to 7 ms; {OURS}: radio",
    )
    position_noise: float = _number(
        0.001, "standard deviation of position [m]", "Merriaux and others 2017, Vicon in motion: error below 2 mm"
    )
    attitude_noise: Angle = _number(
        0.01, "standard deviation of small rotations about each axis [rad]", f"{OURS}: 1 mm over markers 0.1 m apart"
    )


class GpsSettings(Timed):
    """A satellite receiver: position and velocity, its slow error counted from the start."""

    rate: int = Field(10, ge=1, description="measurements per second [Hz]; u-blox NEO-M9N: up to 25; PX4 asks for 10")
    delay_ms: int = Field(
        110, ge=0, le=1000, description="from a measurement to its arrival [ms]; PX4: EKF2_GPS_DELAY 110 ms"
    )
    position_noise: float = _number(0.5, "standard deviation of position, white [m]", "PX4: EKF2_GPS_P_NOISE 0.5 m")
    velocity_noise: float = _number(
        0.05, "standard deviation of velocity [m/s]", "u-blox NEO-M9N data sheet: 0.05 m/s"
    )
    wander: float = _number(
        1.7, "standard deviation of the slow error of position, in the long run [m]",
        "u-blox NEO-M9N data sheet: 2.0 m CEP, over 1.1774",
    )  # fmt: skip
    wander_time: float = _number(60.0, "its correlation time [s]", "PX4 SITL, gazebo_gps_plugin.h: 60 s", gt=0.0)


class AlignedSettings(Strict):
    """The attitude that an autopilot has found at rest on the ground, before it took off."""

    attitude: Angle = _number(
        0.03, "standard deviation about each axis [rad]",
        "0.02 by 20 mg of the accelerometer's bias, 0.028 by 0.6 uT of a horizontal field of 21.6 uT",
    )  # fmt: skip


class MagnetometerSettings(Timed):
    """A magnetometer, calibrated."""

    rate: int = Field(50, ge=0, description="measurements per second [Hz]; PX4: EKF2 takes up to 50")
    noise: float = _number(0.6e-6, "standard deviation [T]", "Bosch BMM150: 0.6 uT rms in the regular preset")
    field: Three = Field(
        (21.6e-6, 0.0, -43.3e-6),
        description="of the place: north is forward [T]; WMM 2025, Zurich, without declination",
    )


class BarometerSettings(Timed):
    """A barometer, counted from the start."""

    rate: int = Field(50, ge=0, description="measurements per second [Hz]; Bosch BMP388: up to 200")
    noise: float = _number(0.1, "standard deviation, white [m]", "TE MS5611: 10 cm resolution")
    wander: float = _number(0.66, "standard deviation of the slow error [m]", "Bosch BMP388: relative accuracy 8 Pa")
    wander_time: float = _number(600.0, "its correlation time [s]", f"{OURS}: weather and warming", gt=0.0)


class TachometerSettings(Timed):
    """Rotor speeds; off unless asked for."""

    on: bool = Field(False, description="whether rotor speeds are measured")
    rate: int = Field(500, ge=0, description=f"measurements per second [Hz]; {OURS}: bidirectional DShot gives more")
    delay_ms: int = Field(2, ge=0, le=1000, description=f"from a measurement to its arrival [ms]; {OURS}")
    noise: float = _number(
        5.0, "standard deviation [rad/s]", f"{OURS}: 1 % of 500 rad/s, as eRPM has a mantissa of 9 bits"
    )


class FlowSettings(Timed):
    """The PMW3901 of a flow deck."""

    rate: int = Field(
        100, ge=1, description="measurements per second [Hz]; crazyflie-firmware, flowdeck: every 10 ms"
    )
    noise: float = _number(
        0.2 * 0.71674 / 35.0 / 0.01, "standard deviation [rad/s]",
        "crazyflie-firmware: 2.0 x 0.1 pixel of 0.71674/35 rad in 10 ms",
    )  # fmt: skip
    largest: float = _number(7.4, "largest flow that it follows [rad/s]", "PixArt PMW3901MB: 7.4 rad/s", gt=0.0)


class RangeSettings(Timed):
    """The VL53L1x of a flow deck."""

    rate: int = Field(50, ge=1, description="measurements per second [Hz]; ST VL53L1X: up to 50")
    noise: float = _number(0.0025, "standard deviation [m]", "crazyflie-firmware, zranger2: expStdA 2.5 mm")
    farthest: float = _number(4.0, "end of its range [m]", "ST VL53L1X: 4 m", gt=0.0)


class MarkSettings(Strict):
    """The mark on the floor that the vehicle is put on."""

    position: float = _number(0.01, "standard deviation of where it stands [m]", f"{OURS}: by hand")
    attitude: Angle = _number(0.02, "standard deviation of how it is turned [rad]", f"{OURS}: by hand")


class SetSignals(NamedTuple):
    """What is wrong with the inertial readings, which an estimator has to find."""

    gyro_bias: Annotated[Vec3, Quantity("rad/s", BODY, "true bias of the gyro")]
    accelerometer_bias: Annotated[Vec3, Quantity("m/s^2", BODY, "true bias of the accelerometer")]


class SensorSet(Sensors[Any, Any]):
    """Devices put together. Each is a group of the settings, of the same name."""

    devices: ClassVar[dict[str, type[Device[Any, Any]]]] = {}
    limits_grid: ClassVar[bool] = True
    estimator: ClassVar[str] = "eskf"
    imu_filter: ClassVar[str] = "rotor_notch"
    sensor_check: ClassVar[str] = "repeats"
    Telemetry = SetSignals

    def __init__(self, settings: Any = None) -> None:
        super().__init__(settings)
        self.made = {name: kind(getattr(self.settings, name)) for name, kind in self.devices.items()}
        self.normals = sum(device.normals for device in self.made.values())  # type: ignore[misc]
        self.first_normals = sum(device.first_normals for device in self.made.values())  # type: ignore[misc]
        self._record = record_type("Devices", tuple(self.made))

    def off_grid(self, grid: TimeGrid) -> tuple[str, str] | None:
        """Rates and delays that are no whole numbers of sampling periods."""
        wrong = (device.off_grid(name, grid.period) for name, device in self.made.items())
        return next((one for one in wrong if one is not None), None)

    def parameters(self, context: Context) -> Any:
        """Numbers of each device."""
        return self._record(*(device.parameters(context) for device in self.made.values()))

    def model(self, context: Context) -> SensorModel:
        """What the data sheets say."""
        parts: dict[str, Any] = {}
        for device in self.made.values():
            parts |= device.model(context)
        return SensorModel(**parts)

    def initial(self, inputs: SensorInputs, parameters: Any) -> Any:
        """Memory of each device."""
        memories, used = [], 0
        for (_, device), numbers in zip(self.made.items(), parameters, strict=True):
            count = device.first_normals
            memories.append(device.initial(inputs._replace(normals=inputs.normals[used : used + count]), numbers))
            used += count
        return self._record(*memories)

    def step(self, memory: Any, inputs: SensorInputs, parameters: Any, dt: Scalar) -> tuple[Any, Readings, Record]:
        """Readings of all devices."""
        readings: dict[str, Any] = {}
        after, used = [], 0
        for device, before, numbers in zip(self.made.values(), memory, parameters, strict=True):
            own = inputs._replace(normals=inputs.normals[used : used + device.normals])
            used += device.normals
            one, given = device.read(before, own, numbers, dt)
            after.append(one)
            readings |= given
        signals = SetSignals(memory.imu.gyro_bias, memory.imu.force_bias)
        return self._record(*after), Readings(**readings), signals


@final
@register("mocap")
class Mocap(SensorSet):
    """An inertial unit, and position and attitude by motion capture."""

    devices: ClassVar[dict[str, type[Device[Any, Any]]]] = {"imu": Imu, "mocap": Fix, "rotor_speeds": Tachometer}

    class Settings(Strict):
        """Each device by itself."""

        imu: ImuSettings = _group(ImuSettings)
        mocap: MocapSettings = _group(MocapSettings)
        rotor_speeds: TachometerSettings = _group(TachometerSettings)


@final
@register("gps-consumer")
class GpsConsumer(SensorSet):
    """An inertial unit, a satellite receiver, a magnetometer and a barometer of a consumer autopilot."""

    devices: ClassVar[dict[str, type[Device[Any, Any]]]] = {
        "imu": Imu, "aligned": Mark, "gps": Fix, "magnetometer": Magnetometer, "barometer": Barometer,
        "rotor_speeds": Tachometer,
    }  # fmt: skip

    class Settings(Strict):
        """Each device by itself."""

        imu: ImuSettings = _group(ImuSettings)
        aligned: AlignedSettings = _group(AlignedSettings)
        gps: GpsSettings = _group(GpsSettings)
        magnetometer: MagnetometerSettings = _group(MagnetometerSettings)
        barometer: BarometerSettings = _group(BarometerSettings)
        rotor_speeds: TachometerSettings = _group(TachometerSettings)


@final
@register("crazyflie")
class Crazyflie(SensorSet):
    """An inertial unit, flow and range of a Crazyflie 2.1 that takes off from a mark."""

    devices: ClassVar[dict[str, type[Device[Any, Any]]]] = {
        "imu": Imu, "mark": Mark, "flow": FlowCamera, "range": RangeFinder, "rotor_speeds": Tachometer,
    }  # fmt: skip

    class Settings(Strict):
        """Each device by itself."""

        imu: CrazyflieImu = _group(CrazyflieImu)
        mark: MarkSettings = _group(MarkSettings)
        flow: FlowSettings = _group(FlowSettings)
        range: RangeSettings = _group(RangeSettings)
        rotor_speeds: TachometerSettings = _group(TachometerSettings)
