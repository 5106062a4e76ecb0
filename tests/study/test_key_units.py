"""Units of the inputs come from the schema: the name of a key is no unit."""

from pathlib import Path

import pyarrow.parquet as pq
import pytest
import toy

from mcsettle.report.register import entries
from mcsettle.run.columns import parameter_columns
from mcsettle.run.pipeline import run_study
from mcsettle.storage.tables import input_column
from mcsettle.study.key_paths import number_paths
from mcsettle.study.key_units import input_units, unit_at
from mcsettle.study.parameter_sets import all_sets
from mcsettle.study.study import Study, load_study
from mcsettle.study.written import study_data
from mcsettle.summary.results import read_results

STUDIES = Path(__file__).resolve().parents[2] / "studies"
EXPONENT = "track.layers.subgrade.settlement_m"
LOAD = "trains.passenger.axle_load_t"


def study() -> Study:
    """An exponent whose name ends in that of a unit is uncertain, and a load too."""
    spread = {"distribution": "uniform", "low": 1.0, "high": 3.0}
    return toy.uncertain(
        {"input": EXPONENT, **spread}, toy.LOAD, run={"realisations": 2, "parameter_sets": 2}
    )


@pytest.mark.parametrize("name", ["linespeed_observed", "traffic_uncertain", "line", "charges"])
def test_every_number_whose_name_ends_in_a_unit_has_it_but_for_the_exponents(name: str) -> None:
    ends = {"_pa": "Pa", "_mm": "mm", "_m": "m", "_kmh": "km/h", "_kg": "kg", "_years": "year",
            "_days": "d", "_kg_per_m3": "kg/m3", "_n_per_m": "N/m", "_ns_per_m": "N s/m",
            "_ns_per_m2": "N s/m2", "_n_per_m2": "N/m2", "_kg_m2": "kg m2", "_m2": "m2", "_m4": "m4",
            "_per_mpa2": "1/MPa2", "_per_track_km": "GBP/track-km", "_mgt_per_day": "MGT/d",
            "_thousand_per_year": "1000/year"}  # fmt: skip
    data = study_data(load_study(STUDIES / f"{name}.toml"))
    seen = 0
    for path in number_paths(data):
        fitting = [end for end in ends if f"_{path.rpartition('.')[2]}".endswith(end)]
        if fitting and not path.endswith("settlement_m"):
            assert unit_at(data, path) == ends[max(fitting, key=len)], path
            seen += 1
    assert seen > 50


@pytest.mark.usefixtures("few_resamples")
def test_an_exponent_is_no_length(tmp_path: Path) -> None:
    uncertain = study()
    units = {input_column(EXPONENT): "1", input_column(LOAD): "t"}
    assert input_units(uncertain) == units
    assert parameter_columns(all_sets(uncertain), units)["unit"][:2] == ["1", "t"]
    register = {entry.path: entry.unit for entry in entries(uncertain)}
    assert (register[EXPONENT], register[LOAD]) == ("", "t")
    out = tmp_path / "run"
    run_study(uncertain, out)
    schema = pq.read_schema(next((out / "realisations").glob("*.parquet")))
    assert {c: schema.field(c).metadata[b"unit"].decode() for c in units} == units
    labelled = read_results(out).to_xarray()
    assert {c: labelled[c].attrs["units"] for c in units} == units
