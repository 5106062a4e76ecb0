"""Results as labelled arrays: the same numbers, in the study's order, with units."""

import sys
from pathlib import Path

import made_run
import numpy as np
import pytest

from mcsettle.errors import InputError
from mcsettle.summary.results import read_results

DAYS = {"v201": [700.0, 650.0, 720.0], "v225": [500.0, 480.0, 510.0]}


def test_every_number_is_where_its_row_was(tmp_path: Path) -> None:
    results = read_results(made_run.write(tmp_path / "run", made_run.study(), DAYS))
    data = results.to_xarray()
    assert data["tamping_interval_days"].dims == (
        *("scenario", "variant", "parameter_set", "realisation"),
    )
    assert list(data["scenario"].values) == list(results.study.scenario_names)
    for table, names in (
        (results.realisations, ("tamping_interval_days", "sd_final_mm")),
        (results.effects, ("reduction_percent", "marginal_cost")),
    ):
        for row in table.to_dict("records"):
            at = {str(dim): row[str(dim)] for dim in data["sd_final_mm"].dims}
            for name in names:
                np.testing.assert_equal(float(data[name].sel(at)), row[name])
    assert data["tamping_interval_days"].attrs["units"] == "d"
    assert data["sd_final_mm"].attrs["units"] == "mm"
    assert "train-km" in data["marginal_cost"].attrs["units"]
    assert np.isnan(data["marginal_cost"].sel(scenario="v201")).all()


def test_without_xarray_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    results = read_results(made_run.write(tmp_path / "run", made_run.study(), DAYS))
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match=r"mcsettle\[xarray\]"):
        results.to_xarray()
