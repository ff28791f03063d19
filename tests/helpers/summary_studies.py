"""Small studies with summaries."""

from __future__ import annotations

from typing import Any

_HOVER = {"duration": 1.5, "start.position": [0.0, 0.0, 0.0], "reference.position": [0.0, 0.0, 0.0]}


def _lost(vehicle: str, preset: str, *rotors: int) -> dict[str, Any]:
    faults = [{"kind": "total", "rotor": rotor, "time": 0.2} for rotor in rotors]
    return {
        "label": f"{vehicle} {rotors}",
        "settings": {"vehicle": vehicle, "controller.preset": preset, "fault": faults},
    }


TOTAL_LOSS: dict[str, Any] = {
    "name": "few-losses",
    "scenario": "hover-fault",
    "summary": "total-loss",
    "settings": _HOVER,
    "axis": [
        {
            "name": "diagnosis",
            "case": [
                {"label": "luenberger", "settings": {"diagnosis": {"kind": "luenberger"}}},
                {"label": "told", "settings": {"diagnosis": {"kind": "delayed", "delay": 0.05}}},
            ],
        },
        {"name": "height", "values": [0.5, 6.0]},
        {
            "name": "start",
            "case": [
                {"label": "hover", "draw": [{"name": "wind_speed", "choice": [5.0]}]},
                {
                    "label": "thrown",
                    "draw": [
                        {"name": "wind_speed", "choice": [3.0]},
                        {"name": "start.attitude.1", "sine": [-1.5, 1.5]},
                        {"name": "start.body_rates.0", "uniform": [-10.0, 10.0]},
                    ],
                },
            ],
        },
        {"name": "lost", "case": [_lost("mueller-2014", "quiet", 1), _lost("paper", "quiet", 1, 2)]},
    ],
    "draw": [{"name": "wind_direction", "uniform": [-3.0, 3.0]}],
    "variant": [
        {"label": "ours", "settings": {"controller.kind": "roismc"}},
        {"label": "theirs", "settings": {"controller.kind": "smc"}},
    ],
    "refine": {"initial": 3, "block": 3, "most": 3},
    "quick": {"flights": 1, "keep": {"height": [6.0], "start": ["hover"]}},
}

DETECTION: dict[str, Any] = {
    "name": "few-detections",
    "scenario": "hover-fault",
    "summary": "detection",
    "grading": "detection",
    "settings": {
        "vehicle": "hummingbird",
        "controller.preset": "gentle",
        "duration": 1.0,
        "fault": [{"kind": "step", "rotor": rotor, "time": 0.4, "loss": 0.0} for rotor in (1, 2, 3, 4)],
    },
    "axis": [
        {"name": "loss", "values": [0.0, 0.06, 0.4]},
        {
            "name": "manoeuvre",
            "case": [{"label": "hover"}, {"label": "gusts", "settings": {"wind.wind_at_6m": 8.0}}],
        },
    ],
    "draw": [
        {"name": "rotor_of_four", "choice": [1.0, 2.0, 3.0, 4.0]},
        {"name": "onset", "uniform": [0.3, 0.5]},
        {"name": "rotor_bandwidth", "uniform": [0.5, 1.5]},
    ],
    "variant": [
        {"label": "as it is", "settings": {"diagnosis": "luenberger"}},
        {
            "label": "eager",
            "settings": {
                "diagnosis": {
                    "kind": "luenberger",
                    "decision": {"threshold": 0.02, "clear_threshold": 0.01, "noise": 0.1},
                }
            },
        },
    ],
    "refine": {"initial": 8, "block": 8, "most": 8},
}
