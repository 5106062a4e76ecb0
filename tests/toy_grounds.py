"""Three possible grounds of two segments under the toy track; one has peat, which no law covers."""

from pathlib import Path
from typing import Any

import toy

from mcsettle.study.study import Study

LAYERS = """soilprofile_id;top_level;soil_name;
A1;60.0;raise;
A1;3.0;fill;
A1;1.0;clay;
A1;-4.0;sand;
A2;60.0;raise;
A2;3.0;fill;
A2;2.0;peat;
A2;0.5;sand;
B1;60.0;raise;
B1;1.0;fill;
B1;0.5;sand;
"""
WEIGHTS = """segment_id;soilprofile_id;probability;calculation_type
A;A1;70;Stability
A;A2;30;Stability
B;B1;100;Stability
"""


def soil(modulus: float, **more: Any) -> dict[str, Any]:
    law = {"settlement_a": 0.64, "settlement_b": 0.1, "settlement_m": 1.7, "strength_pa": 1e5}
    base = {"youngs_modulus_pa": modulus, "poisson": 0.3, "density_kg_per_m3": 1900.0}
    return {**base, "damping": 0.03, **law, **more}


MATERIALS = {
    "fill": soil(1e8),
    "clay": soil(4e7, settlement_a=1.2, settlement_b=0.18, settlement_m=2.4, strength_pa=6e4),
    "sand": soil(9e7),
    "peat": {**{k: v for k, v in soil(8e6).items() if not k.startswith(("settle", "strength"))},
             "no_law": "peat"},
}  # fmt: skip


def study(folder: Path, **grounds: Any) -> Study:
    data = toy.study().model_dump(by_alias=True, exclude_none=True)
    own = {"layers": "layers.csv", "weights": "weights.csv", "leave_out": ["raise"],
           "materials": MATERIALS, "depth_m": 8.0}  # fmt: skip
    del data["vehicles"], data["include"], data["uncertain"], data["correlations"]
    del data["track"]["ground"]
    return Study.from_mapping({**data, "grounds": own | grounds}, folder=folder)
