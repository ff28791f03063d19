"""Flight logs that tests make: a simple vehicle whose rotors, wind and noise are known, in all formats."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rotorfault.logs.commands import directions
from rotorfault.logs.log import Log, Series, named_layout

Array = NDArray[np.float64]
RATE = 100.0  # Hz
HOVER = 0.45
GAIN = np.array([60.0, 60.0, 5.0]) / HOVER  # rad/s^2 per command


class Flown(NamedTuple):
    """A flight of the simple vehicle: angular motion under rate control, hovering."""

    time: Array
    command: Array  # (n, 4)
    rates: Array  # (n, 3)
    force: Array  # (n, 3)
    velocity: Array
    position: Array
    frame: str = "quad-x"


def flown(
    seed: int = 0,
    seconds: float = 30.0,
    rotor: int | None = None,
    loss: float = 0.0,
    onset: float = 20.0,
    imbalance: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0),
    noise: float = 0.01,
    push: tuple[float, float, float] = (0.0, 0.0, 0.0),
    lag: float = 0.03,
    frame: str = "quad-x",
    stirred: float = 0.0,
) -> Flown:
    """Fly it: rotors lag, attitude is held by a PD law, height by what the mean command has to be.

    `stirred` moves the attitude that is wanted about all axes by so many rad, as a pilot does.
    """
    rng = np.random.default_rng(seed)
    rows = directions(named_layout(frame, ""))
    motors = rows.shape[1]
    mixer = np.linalg.pinv(np.vstack([np.ones(motors), rows]))
    step, count = 1.0 / RATE, int(seconds * RATE)
    omega, angle, integral, rotors = np.zeros(3), np.zeros(3), np.zeros(3), np.full(motors, HOVER)
    gust = np.zeros(3)
    strength = np.exp(np.array(imbalance)) if motors == 4 else np.ones(motors)
    command, rates, force = np.zeros((count, motors)), np.zeros((count, 3)), np.zeros((count, 3))
    lift = 0.0
    for k in range(count):
        now = k * step
        left = strength.copy()
        if rotor is not None and now >= onset:
            left[rotor] *= 1.0 - loss
        measured = omega + noise * rng.normal(size=3)
        off = angle - stirred * np.sin(2.0 * np.pi * np.array([0.9, 0.7, 0.5]) * now + np.arange(3.0))
        integral = integral + off * step
        wanted = -(14.0 * measured + 60.0 * off + 30.0 * integral) / GAIN / 1.0
        mean = float(np.clip(HOVER - 0.3 * lift, 0.1, 0.9))
        asked = np.clip(mixer @ np.concatenate([[motors * mean], wanted]), 0.0, 1.0)
        rotors = rotors + (asked - rotors) * (1.0 - np.exp(-step / lag))
        gust = gust * 0.98 + 0.001 * rng.normal(size=3)
        pushed = np.array(push) if now >= onset else np.zeros(3)
        omega = omega + step * GAIN * (rows @ (left * rotors) + gust + pushed)
        angle = angle + step * omega
        felt = 9.80665 * float((left * rotors).mean()) / HOVER
        lift += step * (felt - 9.80665) / 9.80665
        command[k], rates[k] = asked, omega + noise * rng.normal(size=3)
        force[k] = [0.02, -0.02, felt + 0.05 * rng.normal()]
    time = 10.0 + step * np.arange(count)
    height = np.clip(np.arange(count) * step, 0.0, 2.0)
    still = np.zeros((count, 3))
    return Flown(time, command, rates, force, still, np.column_stack([0 * height, 0 * height, height]), frame)


def log_of(flight: Flown, name: str = "made-up") -> Log:
    """The flight as a log."""
    series = {
        "command": Series(flight.time, flight.command), "rates": Series(flight.time, flight.rates),
        "specific_force": Series(flight.time, flight.force), "velocity": Series(flight.time, flight.velocity),
        "position": Series(flight.time, flight.position),
    }  # fmt: skip
    return Log(name, "made up", named_layout(flight.frame, "a test"), series)


def level(log: Log) -> Log:
    """The log with a level attitude."""
    time = log.series["command"].time
    still = np.zeros((len(time), 4))
    still[:, 0] = 1.0
    return Log(log.source, log.kind, log.layout, {**log.series, "attitude": Series(time, still)})


def write_csv(flight: Flown, path: Path, says: str | None = None) -> Path:
    """The flight as our documented table; above it stands its frame, or what else it is to say."""
    count = flight.command.shape[1]
    names = ["time", *(f"motor_{k + 1}" for k in range(count)), "gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y",
             "acc_z", "vx", "vy", "vz", "x", "y", "z"]  # fmt: skip
    table = np.column_stack([flight.time, *flight[1:6]])
    head = f"# motors = {flight.frame}" if says is None else says
    lines = [head, ",".join(names), *(",".join(f"{v:.9g}" for v in row) for row in table)]
    path.write_text("\n".join(filter(None, lines)) + "\n")
    return path


FLIP = np.array([1.0, -1.0, -1.0])


def _message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def write_ulog(flight: Flown, path: Path, generation: str = "new") -> Path:
    """The flight as a ULog of one of the three generations of topics: old, middle or new."""
    rows = directions(named_layout("quad-x", ""))
    scale = np.array([0.70710678, 0.70710678, 1.0])
    torque = (flight.command @ rows.T) / 4.0 / scale * FLIP
    thrust = flight.command.mean(axis=1)
    rates, force = flight.rates * FLIP, flight.force * FLIP
    place, speed = flight.position * FLIP, flight.velocity * FLIP
    floats = {"f4": "float"}
    topics: list[tuple[str, list[tuple[str, int]], Array]] = [
        ("vehicle_local_position", [("x", 0), ("y", 0), ("z", 0), ("vx", 0), ("vy", 0), ("vz", 0)],
         np.hstack([place, speed])),
    ]  # fmt: skip
    if generation == "new":
        up = np.column_stack([0 * thrust, 0 * thrust, -thrust])
        topics += [("vehicle_torque_setpoint", [("xyz", 3)], torque), ("vehicle_thrust_setpoint", [("xyz", 3)], up)]
    else:
        topics.append(("actuator_controls_0", [("control", 4)], np.column_stack([torque, thrust])))
    if generation == "old":
        both = np.hstack([rates, force])
        topics.append(("sensor_combined", [("gyro_rad", 3), ("accelerometer_m_s2", 3)], both))
    else:
        topics += [("vehicle_angular_velocity", [("xyz", 3)], rates), ("vehicle_acceleration", [("xyz", 3)], force)]
    parameters = {"MAV_TYPE": 2}
    geometry = {"CA_ROTOR_COUNT": 4.0}
    for k, ((x, y), turn) in enumerate(
        zip(named_layout("quad-x", "").places, (0.05, 0.05, -0.05, -0.05), strict=True)
    ):
        geometry |= {f"CA_ROTOR{k}_PX": x, f"CA_ROTOR{k}_PY": -y, f"CA_ROTOR{k}_KM": turn}
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    for name, fields, _ in topics:
        text = "".join(f"{floats['f4']}{f'[{n}]' if n else ''} {field};" for field, n in fields)
        out += _message("F", f"{name}:uint64_t timestamp;{text}".encode())
    for key, value in parameters.items():
        word = f"int32_t {key}".encode()
        out += _message("P", bytes([len(word)]) + word + struct.pack("<i", value))
    for key, value in (geometry if generation == "new" else {}).items():
        kind = "int32_t" if key == "CA_ROTOR_COUNT" else "float"
        word = f"{kind} {key}".encode()
        body = struct.pack("<i", int(value)) if kind == "int32_t" else struct.pack("<f", value)
        out += _message("P", bytes([len(word)]) + word + body)
    for number, (name, _, _) in enumerate(topics):
        out += _message("A", struct.pack("<BH", 0, number) + name.encode())
    out += _message("L", b"6" + struct.pack("<Q", 10_000_000) + b"hello")
    pieces = [out]
    for k, time in enumerate(flight.time):
        stamp = struct.pack("<Q", int(time * 1e6))
        for number, (_, _, values) in enumerate(topics):
            pieces.append(_message("D", struct.pack("<H", number) + stamp + values[k].astype("<f4").tobytes()))
    path.write_bytes(b"".join(pieces))
    return path


def write_dataflash(flight: Flown, path: Path, every: int = 4) -> Path:
    """The flight as a dataflash log."""
    rows = directions(named_layout("quad-x", ""))
    torque = (flight.command @ rows.T) / 4.0 / 0.5 * FLIP
    formats = [
        (129, "PARM", "QNff", "TimeUS,Name,Value,Default"), (130, "RATE", "Qffff", "TimeUS,ROut,POut,YOut,AOut"),
        (131, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
        (132, "XKF1", "QBffffff", "TimeUS,C,VN,VE,VD,PN,PE,PD"), (133, "MSG", "QZ", "TimeUS,Message"),
    ]  # fmt: skip
    sizes = {"Q": 8, "N": 16, "f": 4, "B": 1, "Z": 64}
    out = b""
    for number, name, form, columns in formats:
        length = 3 + sum(sizes[c] for c in form)
        out += b"\xa3\x95\x80" + struct.pack(
            "<BB4s16s64s", number, length, name.encode(), form.encode(), columns.encode()
        )
    for key, value in {"FRAME_CLASS": 1.0, "FRAME_TYPE": 1.0}.items():
        out += b"\xa3\x95\x81" + struct.pack("<Q16sff", 0, key.encode(), value, value)
    out += b"\xa3\x95\x85" + struct.pack("<Q64s", int(flight.time[-1] * 1e6), b"Potential Thrust Loss (3)")
    pieces = [out]
    for k in range(0, len(flight.time), every):
        stamp = int(flight.time[k] * 1e6)
        pieces.append(b"\xa3\x95\x82" + struct.pack("<Qffff", stamp, *torque[k], flight.command[k].mean()))
        motion = np.concatenate([flight.rates[k] * FLIP, flight.force[k] * FLIP])
        pieces.append(b"\xa3\x95\x83" + struct.pack("<QBffffff", stamp, 0, *motion))
        place = np.concatenate([flight.velocity[k] * FLIP, flight.position[k] * FLIP])
        pieces.append(b"\xa3\x95\x84" + struct.pack("<QBffffff", stamp, 0, *place))
    path.write_bytes(b"".join(pieces))
    return path


def write_betaflight(
    flight: Flown,
    path: Path,
    header: bool = True,
    pulses: bool = True,
    units: tuple[str, str, str] = ("us", "", ""),
    order: tuple[int, ...] = (3, 0, 1, 2),
    speeds: bool = False,
    outward: bool = False,
) -> Path:
    """The flight as Betaflight's decoder or its viewer writes it.

    Motors are counted otherwise: rear right, front right, rear left, front left by our quad X. `header` is what a
    viewer writes above; `units` are those of time, gyro and accelerometer; `outward` exchanges the propellers. Thrust
    follows the signal by T = 0.45 u + 0.55 u^2, and the square of the speed.
    """
    count = len(order)
    time_unit, gyro_unit, acc_unit = units
    share = np.clip(flight.command[:, order], 0.0, 1.0)
    signal = (np.sqrt(0.45**2 + 4.0 * 0.55 * share) - 0.45) / (2.0 * 0.55)
    low, high = (1000.0, 2000.0) if pulses else (158.0, 2047.0)
    gyro = {"rad/s": 1.0, "deg/s": np.degrees(1.0), "": np.degrees(1.0)}[gyro_unit] * flight.rates
    acc = flight.force * {"": 2048.0 / 9.80665, "g": 1.0 / 9.80665, "m/s2": 1.0}[acc_unit]
    yaw = -1.0 if outward else 1.0
    columns = {
        "loopIteration": np.arange(len(flight.time)),
        f"time ({time_unit})": flight.time * (1e6 if time_unit == "us" else 1.0),
        **{f"gyroADC[{k}]" + (f" ({gyro_unit})" if gyro_unit else ""): gyro[:, k] * (yaw if k == 2 else 1.0)
           for k in range(3)},
        **{f"accSmooth[{k}]" + (f" ({acc_unit})" if acc_unit else ""): acc[:, k] for k in range(3)},
        **{f"motor[{k}]": np.rint(low + (high - low) * signal[:, k]) for k in range(count)},
        **({f"eRPM[{k}]": np.rint(2500.0 * np.sqrt(share[:, k])) for k in range(count)} if speeds else {}),
        "vbatLatest (V)": np.full(len(flight.time), 15.8),
    }  # fmt: skip
    table = np.column_stack([*columns.values()])
    text = [",".join([*(f"{v:.10g}" for v in row), "ANGLE_MODE|AIRMODE"]) for row in table]
    names = [*columns, "flightModeFlags (flags)"]
    above = ['"Product","Blackbox flight data recorder by Nicholas Sherlock"', '"Firmware type","Cleanflight"',
             f'"motorOutput","{low:.0f},{high:.0f}"', '"gyro_scale","0x3f800000"', '"acc_1G","2048"',
             '"motor_poles","12"']  # fmt: skip
    path.write_text("\n".join([*(above if header else []), ", ".join(names), *text]) + "\n")
    return path


LOG_WRITERS = {"a.ulg": write_ulog, "a.bin": write_dataflash, "a.csv": write_csv, "b.csv": write_betaflight}


def mangled(content: bytes, seed: int) -> bytes:
    """A log with some of its bytes turned, moved, doubled or gone."""
    rng = np.random.default_rng(seed)
    out = bytearray(content)
    if rng.random() < 0.2:
        out[: int(rng.integers(1, 200))] = rng.bytes(int(rng.integers(0, 200)))
    for _ in range(int(rng.integers(1, 30))):
        at = int(rng.integers(0, max(len(out), 1)))
        size = int(rng.integers(1, 400))
        kind = rng.integers(0, 4)
        if kind == 0:
            out[at : at + size] = rng.bytes(size)
        elif kind == 1:
            del out[at : at + size]
        elif kind == 2:
            out[at:at] = out[max(0, at - size) : at]
        else:
            out[at : at + 1] = rng.bytes(1)
    return bytes(out)
