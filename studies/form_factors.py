"""Settlement factors of the model forms: what puts the median of 201 km/h at 697 days, linear ground.

Run: ``python studies/form_factors.py [--realisations 200]``.
"""

import argparse
import tomllib
from pathlib import Path
from typing import Any

from mcsettle.analysis.calibration import calibrate
from mcsettle.study.study import Study

STUDY = Path(__file__).with_name("linespeed.toml")
VARIANT, SCENARIO, DAYS = "linear", "v201", 697.0
FIELD = {"correlation_length_m": 5.0}
FORMS: dict[str, dict[str, Any]] = {
    "the paper's mechanism": {},
    "rail that bends, next to nothing of its load": {"rail_bending_share": 1e-9},
    "half of it": {"rail_bending_share": 0.5},
    "all of it": {"rail_bending_share": 1.0},
    "support varies, 0.1": {"spatial_variability": FIELD | {"cov": 0.1}},
    "support varies, 0.2": {"spatial_variability": FIELD | {"cov": 0.2}},
    "support varies, 0.3 lognormal": {
        "spatial_variability": FIELD | {"cov": 0.3, "distribution": "lognormal"}
    },
    "total stress, support varies, 0.1": {
        "stress": "total",
        "spatial_variability": FIELD | {"cov": 0.1},
    },
    "long run of 1e6 cycles": {"long_run_cycles": 1e6},
    "cycles by the cube of their load": {
        "cycles": "equivalent",
        "equivalence_exponent": 3.0,
        "equivalence_history": "reference",
    },
    "whole load on each rail, cars of 22.7 m": {
        "load_per_rail": "whole",
        "trains": {"passenger": {"car_length_m": 22.7}},
    },
}


def main() -> None:
    """Print one table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--realisations", type=int, default=200)
    given = options.parse_args()
    print("| form | factor | uniform settlement, mm |\n|--|--|--|")
    for name, keys in FORMS.items():
        data = tomllib.loads(STUDY.read_text(encoding="utf-8"))
        data["scenarios"] = [s for s in data["scenarios"] if s["name"] == SCENARIO]
        data["variants"] = [v | keys for v in data["variants"] if v["name"] == VARIANT]
        data["run"]["realisations"] = given.realisations
        for key in ("reference", "calibration", "economics", "sources"):
            data.pop(key, None)
        study = Study.from_mapping(data, str(STUDY), STUDY.parent)
        found = calibrate(study, SCENARIO, DAYS, variant=VARIANT)
        print(f"| {name} | {found.factor:.3g} | {found.mean_settlement_mm:.3g} |", flush=True)


if __name__ == "__main__":
    main()
