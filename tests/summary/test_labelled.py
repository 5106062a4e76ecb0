"""Results as labelled arrays: the same numbers, in the study's order, with units."""

import sys
from pathlib import Path

import made_run
import numpy as np
import pytest

from mcsettle.errors import InputError
from mcsettle.summary.results import read_results

DIMS = ("scenario", "variant", "parameter_set", "realisation")
PRICES = {"effect": None, "baseline": None, "tamping_cost_per_track_km": 5625}
DAYS = {"v201": [700.0, 650.0, 720.0], "v225": [500.0, 480.0, 510.0]}


def test_every_number_is_where_its_row_was(tmp_path: Path) -> None:
    results = read_results(made_run.write(tmp_path / "run", made_run.study(), DAYS))
    data = results.to_xarray()
    assert data["tamping_interval_days"].dims == DIMS
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
    assert data["marginal_cost"].attrs["units"] == "GBP per km/h per 1000 train-km"
    assert np.isnan(data["marginal_cost"].sel(scenario="v201")).all()


def test_results_without_history_or_prices_are_labelled(tmp_path: Path) -> None:
    run = made_run.write(tmp_path / "run", made_run.study(), DAYS)
    spared = read_results(run, prices_only=True)
    assert spared.history.empty
    assert spared.to_xarray().identical(read_results(run).to_xarray())
    bare = read_results(made_run.write(tmp_path / "bare", made_run.study(economics=None), DAYS))
    data = bare.to_xarray()
    assert "marginal_cost" not in data
    assert data["tamping_interval_days"].sel(scenario="v225", realisation=1) == 480.0


def test_a_scenario_with_several_baselines_has_its_effect_over_each(tmp_path: Path) -> None:
    timetables = {
        name: [{"train": "passenger", "speed_kmh": speed, "per_day": per_day}]
        for name, speed, per_day in (("today", 201, 72), ("faster", 225, 72), ("both", 225, 73))
    }
    made = made_run.study(
        scenarios=[{"name": n, "timetable": t} for n, t in timetables.items()],
        effects=[
            {"scenario": "faster", "baseline": "today", "effect": "speed"},
            {"scenario": "both", "baseline": "today", "effect": "tonnage"},
            {"scenario": "both", "baseline": "faster", "effect": "tonnage"},
        ],
        economics=PRICES,
        calibration=None,
    )
    days = {"today": [700.0, 650.0], "faster": [500.0, 480.0], "both": [490.0, 471.0]}
    data = read_results(made_run.write(tmp_path / "run", made, days)).to_xarray()
    assert data["tamping_interval_days"].dims == DIMS
    assert data["reduction_percent"].dims == ("scenario", "baseline", *DIMS[1:])
    both = data["reduction_percent"].sel(scenario="both", realisation=0).squeeze()
    np.testing.assert_allclose(both.sel(baseline="faster"), 100.0 * (1.0 - 490.0 / 500.0))
    np.testing.assert_allclose(both.sel(baseline="today"), 100.0 * (1.0 - 490.0 / 700.0))


def test_without_xarray_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    results = read_results(made_run.write(tmp_path / "run", made_run.study(), DAYS))
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match=r"mcsettle\[xarray\]"):
        results.to_xarray()
