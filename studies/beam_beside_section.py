"""How far the stresses of the closed-form beam are from those of the section.

    python studies/beam_beside_section.py

The study of ``mcsettle init`` on both, each calibrated to the same median interval: what differs is how
much the higher speed shortens it.
"""

import tempfile
import tomllib
from importlib.resources import files

import mcsettle as ms

TARGET_DAYS = 697.0


def reduction(model: str) -> str:
    """Median reduction [%] of the interval at the higher speed, with its factor."""
    data = tomllib.loads(files("mcsettle.cli").joinpath("template.toml").read_text("utf-8"))
    data["track"] = {"model": model}
    data["settlement"].pop("factor_digest")
    found = ms.calibrate(ms.Study.from_mapping(data), "v201", TARGET_DAYS)
    data["settlement"]["settlement_factor"] = found.factor
    with tempfile.TemporaryDirectory() as folder:
        run = ms.run_study(ms.Study.from_mapping(data), f"{folder}/run")
        table = ms.summarise(run.folder)
    row = table[(table["metric"] == "reduction_percent") & (table["scenario"] == "v225")].iloc[0]
    return f"{row['p50']:.1f} ± {row['standard_error']:.1f} %, factor {found.factor:.4f}"


if __name__ == "__main__":
    for model in ("beam", "section"):
        print(f"{model}: {reduction(model)}")
