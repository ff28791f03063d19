"""Which page stands where on the site. The pages themselves are plain Markdown, and know nothing of it."""

from __future__ import annotations

# A page, and the pages below it in their order. A name with a star stands for all pages of that pattern that stand
# nowhere else, in alphabetical order: a new page is on the site without a line here.
CHILDREN: dict[str, list[str]] = {
    "index": [
        "tutorials/index", "recipes/index", "conventions", "explanations/index", "reference/index", "survival",
        "paper",
    ],
    "tutorials/index": [
        "tutorials/first-steps",
        "tutorials/paper-case",
        "own-vehicle-and-controller",
        "tutorials/own-parts",
        "tutorials/survival-map",
        "tutorials/own-log",
        "tutorials/*",
        "notebooks/first-flight",
        "notebooks/detection-delay",
        "notebooks/gain-sweep",
        "notebooks/*",
    ],
    "recipes/index": [
        "recipes/fail-a-motor",
        "recipes/add-wind",
        "recipes/which-motor-is-1",
        "recipes/own-vehicle",
        "recipes/change-a-gain",
        "recipes/compare-controllers",
        "recipes/own-detector",
        "recipes/survivable",
        "recipes/which-motor-failed",
        "recipes/read-a-flight-file",
        "recipes/repeat",
        "recipes/*",
    ],
    "explanations/index": [
        "explanations/truth-and-belief",
        "controllers/index",
        "diagnosis",
        "detectors",
        "sensing",
        "allocation",
        "attainable",
        "total-loss",
        "opponents",
        "detection",
        "frames",
        "riccati",
        "explanations/fair-comparison",
        "explanations/statistics",
        "explanations/left-out",
        "explanations/*",
        "architecture",
        "performance",
        "scale",
    ],
    "controllers/index": [f"controllers/{name}" for name in ("roismc", "smc", "ismc", "sdre", "*")],
    "reference/index": [
        "reference/commands",
        "scenarios",
        "vehicles",
        "own-parts",
        "campaign-files",
        "*",
        "reference/*",
        "reference/api/index",
        "changelog",
        "contributing",
        "security",
    ],
}  # fmt: skip

# Files of the repository that are pages of the site, by where they lie.
MOVED = {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md", "SECURITY.md": "security.md"}

# Names of the package, by page of the reference: every name of `rotorfault.__all__` once.
API: dict[str, tuple[str, str, list[str]]] = {
    "fly": (
        "Fly",
        "Single flights, many at once, and what comes back.",
        ["fly", "fly_all", "repeat", "load", "Flight", "fly_many", "Flights", "compare", "Comparison", "view"],
    ),
    "logs": ("Flight logs", "Which rotor, in a log of somebody's flight.", ["diagnose", "LogDiagnosis"]),
    "campaigns": ("Campaigns", "Maps of thousands of flights.", ["campaign", "Campaign"]),
    "before": (
        "Before a flight",
        "What a vehicle and a loop can do, known without flying.",
        ["trim_report", "hover_margin", "torque_reserve", "critical_loss", "critical_pair", "acai",
         "ControlAuthority", "critical_thrust_to_weight", "critical_loss_with", "null_space", "NullSpace"],
    ),
    "tune": ("Tune", "Search of gains.", ["tune", "Tuned"]),
    "files": (
        "Scenarios, vehicles, frames",
        "What a flight is made of, as files and as objects; and the conventions of others.",
        ["load_scenario", "scenario_names", "Scenario", "neighbour", "load_vehicle", "vehicle_names", "Vehicle",
         "import_vehicle", "export_vehicle",
         "convert", "frame_names", "load_frame", "Frame"],
    ),
    "slots": (
        "Parts of your own",
        "The classes that a part derives from, what its step is given, and the check of it.",
        ["Controller", "ControlInputs", "ControlOutput", "Diagnoser", "DiagnosisInputs", "Estimator",
         "EstimatorInputs", "Allocator", "AllocationInputs", "Response", "ResponseInputs", "Decision", "Sensors",
         "SensorInputs", "Wind", "Air", "Fault", "OneRotor", "Effect", "TimeInputs", "ReferenceSource",
         "ReferenceTable", "Ground", "BodyModel", "Settings", "Quantity", "Nothing", "Context", "register",
         "check_block", "BlockReport"],
    ),
    "signals": (
        "Signals and values",
        "What flows between parts.",
        ["State", "Reading", "Readings", "Estimate", "Reference", "Diagnosis", "Wrench", "Allocation", "Vec3", "Mat3",
         "PerRotor", "Quat"],
    ),
    "errors": (
        "Errors and warnings",
        "What is raised, and what is warned of.",
        [
            "InputError", "ControllerWarning", "FaultWarning", "ReferenceWarning", "SensorWarning", "StartWarning",
            "VehicleWarning", "WindWarning",
        ],
    ),
}  # fmt: skip

CHILDREN["reference/api/index"] = [*(f"reference/api/{page}" for page in API), "reference/api/*"]
