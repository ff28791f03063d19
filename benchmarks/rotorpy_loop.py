"""RotorPy's Hummingbird with all that its air does, in RotorPy and here: the same commands, and one autopilot.

What is the same and what is not is said in `rotorfault.bench.rotorpy_plant`. Takes some five minutes, nearly all of
them in RotorPy.
"""

from __future__ import annotations

import argparse

from rotorfault.bench.rotorpy_plant import (
    Apart,
    busy_commands,
    closed_loop,
    flight,
    hummingbird,
    moving_start,
    open_loop,
)

PERIOD = 0.002  # s
SECOND = 500  # periods


def line(name: str, apart: Apart) -> str:
    """A row of the table."""
    numbers = f"{apart.position:>14.1e}{apart.velocity:>16.1e}{apart.body_rates:>15.1e}{apart.command:>13.1e}"
    return f"{name:<46}{numbers}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one start, and a second of the autopilot's flight")
    quick = parser.parse_args().quick
    vehicle = hummingbird()

    columns = f"{'position [m]':>14}{'velocity [m/s]':>16}{'rates [rad/s]':>15}{'command [N]':>13}"
    print(f"{'largest difference in':<46}{columns}")
    for seed in range(1 if quick else 5):
        for step in (0.002, 0.001):
            scenario = flight(vehicle, fault=[], period=PERIOD, step=step)
            apart = open_loop(scenario, busy_commands(vehicle, SECOND, PERIOD, seed), moving_start(seed))
            print(line(f"same commands, start {seed}, steps of {1e3 * step:g} ms", apart))
    for motors, own in (("our lag of thrust", False), ("RotorPy's lag of speed", True)):
        scenario = flight(vehicle, period=PERIOD, duration=1.5 if quick else 3.0)
        apart, _ = closed_loop(scenario, own)
        print(line(f"same autopilot, loss of 30 %, {motors}", apart))


if __name__ == "__main__":
    main()
