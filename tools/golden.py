"""Write the golden flights that tests/flight/test_flight.py compares with.

Run it only when a change is meant, and read the difference.
"""

from pathlib import Path

import numpy as np

import rotorfault as rf

FOLDER = Path(__file__).parent.parent / "tests" / "golden"


def main() -> None:
    """Fly the nominal and the faulty flight and write them as small tables."""
    for name in ("nominal", "faulty"):
        settings = {"duration": 3.0, "record_period": 0.1, **({"fault": []} if name == "nominal" else {})}
        data = rf.fly("paper-set-point", settings=settings, engine="python").data
        table = np.column_stack([data["time"], data["position"], data["attitude"]])
        header = "time,x,y,z,roll,pitch,yaw"
        np.savetxt(FOLDER / f"{name}.csv", table, fmt="%.7f", delimiter=",", header=header, comments="")


if __name__ == "__main__":
    main()
