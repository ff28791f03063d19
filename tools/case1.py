"""Case 1 of the paper under every controller, on both plants, with every diagnosis: a table of what happens.

    python tools/case1.py             the table, in Markdown
    python tools/case1.py --neighbours 100

Nothing is filtered: a crash is a row like any other.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

import rotorfault as rf

ROWS: list[tuple[str, dict[str, Any]]] = [
    ("ROISMC", {}),
    ("ROISMC, rigid body", {"plant": "rigid_body"}),
    ("ROISMC, T_s = 10 ms", {"period": 0.01}),
    ("ROISMC, diagnosis off", {"diagnosis.kind": "off"}),
    ("ROISMC, diagnosis off, rigid body", {"diagnosis.kind": "off", "plant": "rigid_body"}),
    ("ROISMC, oracle", {"diagnosis.kind": "oracle"}),
    ("ROISMC, oracle 100 ms late", {"diagnosis.kind": "delayed"}),
    ("ROISMC, linear observer", {"diagnosis.form": "linear"}),
    ("ROISMC, lag-state observer", {"diagnosis.form": "lag_states"}),
    ("ROISMC, paper's reallocation", {"allocation.kind": "paper_rule"}),
    ("ROISMC, nominal allocation", {"allocation.kind": "nominal"}),
    ("ROISMC, preset paper", {"controller.preset": "paper"}),
    ("ROISMC, six inputs", {"controller.cascade.six_inputs": True}),
    ("ROISMC, updraught 3.6 m/s", {"wind.velocity_W": [-3.33, 1.36, 3.6]}),
    ("ROISMC, downdraught 3.6 m/s", {"wind.velocity_W": [-3.33, 1.36, -3.6]}),
    ("ROISMC, k_d = 0.3, wind along +x", {"mismatch.linear_drag": 2.128, "wind.velocity_W": [3.6, 0.0, 0.0]}),
    ("ROISMC, rotors 15 rad/s", {"mismatch.rotor_bandwidth": 0.3}),
    ("ROISMC, rotors 100 rad/s", {"mismatch.rotor_bandwidth": 2.0}),
    ("ROISMC, noisy sensors", {"sensors.kind": "noisy"}),
    ("SMC", {"controller.kind": "smc"}),
    ("SMC, rigid body", {"controller.kind": "smc", "plant": "rigid_body"}),
    ("SMC, diagnosis off", {"controller.kind": "smc", "diagnosis.kind": "off"}),
    ("SMC matched to ROISMC", {"controller.kind": "smc", "controller.preset": "matched"}),
    ("SMC discontinuous", {"controller.kind": "smc", "controller.preset": "discontinuous"}),
    ("ISMC", {"controller.kind": "ismc"}),
    ("ISMC, rigid body", {"controller.kind": "ismc", "plant": "rigid_body"}),
    ("ISMC, preset paper", {"controller.kind": "ismc", "controller.preset": "paper"}),
    ("SDRE", {"controller.kind": "sdre"}),
    ("SDRE, rigid body", {"controller.kind": "sdre", "plant": "rigid_body"}),
    ("SDRE, preset paper", {"controller.kind": "sdre", "controller.preset": "paper"}),
]


def row(label: str, settings: dict[str, Any]) -> str:
    """One flight as a line of a Markdown table."""
    s = rf.fly("paper-set-point", settings=settings).summary()

    def text(value: float | None, digits: str = ".2f") -> str:
        return "-" if value is None else f"{value:{digits}}"

    hits = ", ".join(
        f"{h['rotor']}: "
        + ("missed" if h["delay"] is None else f"{1e3 * h['delay']:.0f} ms, {text(h['loss_estimated'])}")
        for h in s["detections"]
    )
    return (
        f"| {label} | {s['outcome']} {text(s['end_time'], '.1f')} s | {text(s['settle_time']['overall'])} | "
        f"{text(s['cost'], '.1f')} | {text(s['tilt_max'])} | {hits or '-'} | {s['false_alarms']} |"
    )


def neighbours(count: int, controller: str) -> str:
    """How many seeded neighbours survive, settle in time and flag exactly rotors 1 and 3."""
    settings = {"controller.kind": controller, "duration": 9.0, "record_period": 0.01}
    base = rf.load_scenario("paper-set-point", settings)
    flights = rf.fly_all([rf.neighbour(base, seed=i) for i in range(count)])
    survived, settled, flagged = 0, 0, 0
    for flight in flights:
        data, onset = flight.data, flight.scores["onset.1"]
        step = np.abs(data["position_reference"].values[0] - data["position"].values[0])
        outside = (np.abs(data["position"].values - data["position_reference"].values) > 0.02 * step).any(axis=1)
        time = data["time"].values
        late = outside & ((time > max(2.5, onset + 1.0)) | ((time > 2.5) & (time < onset)))
        survived += flight.outcome.survived
        settled += flight.outcome.survived and not late.any()
        flagged += (data["fault_flag"].values[-1] > 0.5).tolist() == [True, False, True, False]
    return (
        f"{controller}: of {count} neighbours {survived} survive, {settled} settle in time, "
        f"{flagged} flag exactly rotors 1 and 3"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--neighbours", type=int, default=0, metavar="N", help="fly N neighbours per controller too")
    count = parser.parse_args().neighbours
    print("| flight | outcome | settled [s] | cost J | largest tilt [rad] | rotor: delay, loss | false alarms |")
    print("|---|---|---|---|---|---|---|")
    for label, settings in ROWS:
        print(row(label, settings), flush=True)
    for controller in ("roismc", "smc", "ismc", "sdre") if count else ():
        print(neighbours(count, controller), flush=True)


if __name__ == "__main__":
    main()
