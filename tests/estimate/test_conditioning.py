"""Bands conditioned on observations: known posteriors, the pipeline, what is refused.

In the closed-form ensemble the interval of a section is 700 days over the rates of its set and track, so
log T is normal about the set's own value and the posterior of a set's rate is normal too.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import toy
from scipy import stats
from toy import COST, FITTED, INTERVAL, LOAD, N0, uncertain

from mcsettle.errors import InputError
from mcsettle.estimate.conditioning import Conditioning, conditioned
from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.estimate import LEVELS, Estimate
from mcsettle.estimate.likelihood import Median
from mcsettle.estimate.observation import Observation
from mcsettle.estimate.resampling import effective
from mcsettle.estimate.variance import variance_split
from mcsettle.run import factor_fit
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.storage import store
from mcsettle.storage.tables import input_column
from mcsettle.study.parameter_sets import all_sets
from mcsettle.study.study import load_study
from mcsettle.summary.courses import courses
from mcsettle.summary.results import read_results
from mcsettle.summary.spread import _drawn
from mcsettle.summary.summary import summary_rows

OF_SET, OF_TRACK = 0.8, 0.4
SDS = [
    {"scenario": "v201", "section": "km 12", "day": d, "sd_mm": s, "sd_error_mm": 0.02}
    for d, s in ((10.0, 1.10), (20.0, 1.16))
]


def interval(days, error, **more) -> Observation:
    return Observation(None, days, error, "v201", **more)


def ensemble(n_sets=2048, n_tracks=200, seed=0):
    """Log rates of the sets [E] and log days [E, R]."""
    rng = np.random.default_rng([31, seed])
    of_set = OF_SET * stats.norm.ppf(stats.qmc.Sobol(1, rng=rng).random(n_sets))[:, 0]
    return of_set, np.log(700.0) - of_set[:, None] - OF_TRACK * rng.normal(size=n_tracks)


def posterior(log_observed: float, spread: float) -> tuple[float, float]:
    """Mean and SD of a set's log rate after a log interval with this spread was observed."""
    share = OF_SET**2 / (OF_SET**2 + spread**2)
    return share * (np.log(700.0) - log_observed), OF_SET * np.sqrt(1.0 - share)


def rows_of(logs: np.ndarray) -> pd.DataFrame:
    e, r = (index.ravel() for index in np.indices(logs.shape))
    return pd.DataFrame(
        {
            "variant": "base",
            "scenario": "v201",
            "parameter_set": e,
            "realisation": r,
            "status": "reached",
            "tamping_interval_days": np.exp(logs).ravel(),
        }
    )


def weights_of(logs, *entries) -> Conditioning:
    return conditioned("base", entries, courses("base", rows_of(logs), pd.DataFrame()))


@pytest.mark.parametrize("sections", [1, 40])
def test_the_posterior_of_a_normal_is_the_known_one(sections):
    of_set, logs = ensemble()
    seen, error = 400.0, 12.0
    found = weights_of(logs, interval(seen, error, sections=sections))
    if sections == 1:
        spread = np.hypot(OF_TRACK, error / seen)
    else:
        own = 1 / sections + 1 / logs.shape[1]
        spread = np.sqrt((error / seen) ** 2 + 0.5 * np.pi * OF_TRACK**2 * own)
    mean, sd = posterior(np.log(seen), spread)
    # The tracks drawn have a mean of their own, the same in every set: 0.4/√200 = 0.03.
    assert found.weights @ of_set == pytest.approx(mean, abs=0.08)
    assert np.sqrt(found.weights @ (of_set - found.weights @ of_set) ** 2) == pytest.approx(
        sd, rel=0.15
    )
    assert found.effective == pytest.approx(effective(found.weights))
    assert found.usable


def test_two_sections_tell_more_than_one():
    of_set, logs = ensemble()
    one = weights_of(logs, interval(400.0, 12.0))
    same = weights_of(logs, interval(400.0, 12.0), interval(400.0, 12.0))
    two = weights_of(logs, interval(400.0, 12.0, section="a"), interval(400.0, 12.0, section="b"))

    def sd(found):
        return np.sqrt(found.weights @ (of_set - found.weights @ of_set) ** 2)

    assert sd(two) < 0.9 * sd(one)
    assert sd(same) == pytest.approx(sd(one), rel=0.02)  # the same section, measured twice


def test_conditioned_bands_are_those_of_the_posterior():
    _, logs = ensemble()
    seen, error = 300.0, 10.0
    found = weights_of(logs, interval(seen, error))
    mean, sd = posterior(np.log(seen), np.hypot(OF_TRACK, error / seen))
    days = np.exp(logs)
    estimates = CrossedSample(days, "d", weights=found.weights).quantiles(LEVELS)
    for level, estimate in zip(LEVELS, estimates, strict=True):
        truth = 700.0 * np.exp(-mean + np.hypot(sd, OF_TRACK) * stats.norm.ppf(level))
        assert abs(estimate.value - truth) < 4 * estimate.standard_error
    split = variance_split(logs, "logarithm", found.weights)
    assert split.parameters.value == pytest.approx(sd**2 / (sd**2 + OF_TRACK**2), abs=0.05)
    # Weights that are all alike change nothing.
    days = days[:128]
    plain, alike = (
        CrossedSample(days, "d", weights=w).quantiles((0.5,))[0] for w in (None, np.full(128, 3.0))
    )
    assert plain == alike
    mean_ = CrossedSample(days, "d", weights=np.full(128, 0.1)).mean()
    assert mean_.value == pytest.approx(days.mean())


def test_a_median_counts_the_tracks_it_is_taken_from():
    logs = np.log(500.0) + 0.3 * stats.norm.ppf((np.arange(100) + 0.5) / 100)
    wide, narrow = (
        Median.of(interval(500.0, 1.0, sections=n), np.exp(logs[None, :])).log_likelihood()
        for n in (2, 2000)
    )
    assert wide < narrow < 0.0 + 1e-9
    never = Median.of(interval(9.0, 1.0, sections=2), np.full((1, 4), np.inf))
    assert never.log_likelihood() == [-np.inf]


def test_collapsed_weights_give_no_numbers():
    _, logs = ensemble(64, 16)
    exact = weights_of(logs, interval(400.0, 1.0, sections=100_000))
    far = weights_of(logs, interval(1e-3, 1e-6))
    assert exact.effective < 20
    assert "carry the weight" in exact.remark
    assert not far.usable
    assert far.weights.sum() == 0.0
    assert "no parameter set comes near" in far.remark


def test_sds_between_the_days_recorded_and_beyond_the_last():
    rows = rows_of(np.zeros((1, 2)))
    history = pd.DataFrame(
        {
            "variant": "base",
            "scenario": "v201",
            "parameter_set": [0, 0, 0, 0, 0],
            "realisation": [1, 0, 0, 1, 1],
            "day": [0.0, 10.0, 0.0, 10.0, 30.0],
            "sd_mm": [1.0, 1.4, 1.0, 1.1, 1.2],
        }
    )
    course = courses("base", rows, history)["v201"]
    np.testing.assert_allclose(course.sd_on(5.0), [[1.2, 1.05]])
    np.testing.assert_allclose(course.sd_on(20.0), [[1.8, 1.15]])  # as steep as before


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"scenario": "v2", "day": 1.0, "sd_mm": 1.1, "sd_error_mm": 0.1}, "no scenario"),
        ({"scenario": "v201", "day": 1.0, "sd_mm": 1.1}, "either day, sd_mm, sd_error_mm"),
        ({**INTERVAL, "day": 3.0}, "either day, sd_mm, sd_error_mm"),
        ({**SDS[0], "sections": 3}, "an SD is of one section"),
        ({**INTERVAL, "tamping_interval_days": 1e4}, "followed for 730 days"),
        ({**INTERVAL, "error_days": 0.0}, "greater than 0"),
    ],
)
def test_observations_that_cannot_be_are_refused(entry, said):
    with pytest.raises(InputError, match=said):
        uncertain(N0, observed=[entry])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"input": "settlement.ballast_cycles_before"}, "only a settlement_factor can be fitted"),
        (
            {"distribution": "discrete", "low": None, "high": None, "values": [1.0, 2.0]},
            "continuous",
        ),
    ],
)
def test_what_cannot_be_fitted_is_refused(change, said):
    entry = {k: v for k, v in (FITTED | change).items() if v is not None}
    with pytest.raises(InputError, match=said):
        uncertain(entry, observed=[INTERVAL])


def test_a_fit_needs_observations_and_one_variant():
    with pytest.raises(InputError, match="give \\[\\[observed\\]\\] entries"):
        uncertain(FITTED)
    with pytest.raises(InputError, match="several variants follow"):
        uncertain(FITTED, observed=[INTERVAL], variants=[{"name": "a"}, {"name": "b"}])
    with pytest.raises(InputError, match="without \\[\\[uncertain\\]\\] inputs"):
        toy.study(observed=[INTERVAL])


def test_observations_decide_a_run_only_where_something_is_fitted_to_them():
    assert uncertain(N0, observed=[INTERVAL]).digest == uncertain(N0).digest
    first, second = (
        uncertain(FITTED, observed=[{**INTERVAL, "error_days": e}]).digest for e in (3.0, 4.0)
    )
    assert first != second
    sourced = uncertain(FITTED, observed=[{**INTERVAL, "source": "maintenance records"}])
    assert sourced.digest == first


@pytest.fixture(scope="module")
def few_tracks():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(factor_fit, "FIT_TRACKS", 24)
        yield


@pytest.fixture(scope="module")
def finished(fresh_cache, few_resamples, few_tracks, tmp_path_factory):
    """Every set fits its own factor to the median interval of 200 sections."""
    study = uncertain(N0, LOAD, COST, FITTED, observed=[{**INTERVAL, "sections": 200}])
    out = tmp_path_factory.mktemp("fitted") / "results"
    return run_study(study, out, RunOptions(realisations=24, parameter_sets=5))


@pytest.mark.usefixtures("fresh_cache", "few_resamples")
def test_every_set_fits_its_factor(finished):
    """The median of 24 tracks is 60 days in every set, as well as 200 sections and 24 tracks tell."""
    results = read_results(finished.folder)
    rows = results.realisations
    own = rows[rows["scenario"] == "v201"].groupby("parameter_set")
    medians, spread = (
        own["tamping_interval_days"].median(),
        own["tamping_interval_days"].agg(lambda d: np.log(d).std()),
    )
    allowed = np.sqrt(0.05**2 + 0.5 * np.pi * spread**2 * (1 / 200 + 1 / 24))
    miss = np.log(medians / 60.0) / allowed
    assert np.all(np.abs(miss) < 3.5)
    assert 0.3 < np.std(miss) < 2.0  # draws of the posterior, not its middle
    assert (
        rows.groupby("parameter_set")["input_settlement_settlement_factor"].first().nunique() == 5
    )
    found = results.conditioning("base")
    assert found.effective > 4.0  # a scale fits every set alike
    assert all(
        r.conditioned_at(0.5) is not None for r in summary_rows(results) if "growth" not in r.metric
    )


@pytest.mark.usefixtures("fresh_cache", "few_resamples")
def test_growing_keeps_the_fits(finished, tmp_path):
    study = load_study(finished.folder / "study.toml")
    run_study(study, tmp_path, RunOptions(realisations=24, parameter_sets=3))
    first = store.read(tmp_path, "weights").to_pandas()
    run_study(study, tmp_path, RunOptions(realisations=24, parameter_sets=5))
    grown, whole = (
        store.read(folder, "weights").to_pandas() for folder in (tmp_path, finished.folder)
    )
    pd.testing.assert_frame_equal(grown, whole)
    np.testing.assert_array_equal(first["log_likelihood"], grown["log_likelihood"][:3])


@pytest.mark.usefixtures("fresh_cache", "few_resamples")
def test_observations_added_to_a_finished_run_weight_it(tmp_path):
    """No row is computed again; without the observations the weights are gone again."""
    plain = uncertain(
        N0, LOAD, run={"realisations": 16, "parameter_sets": 8, "history_days": [0, 5, 10, 20, 40]}
    )
    run_study(plain, tmp_path)
    before = store.read(tmp_path, "realisations")
    stamps = [p.stat().st_mtime_ns for p in sorted((tmp_path / "realisations").glob("*"))]
    assert read_results(tmp_path).conditioning("base") is None
    wide = [{**entry, "sd_error_mm": 0.2} for entry in SDS]
    seen = plain.from_mapping(
        {**plain.model_dump(by_alias=True, exclude_none=True), "observed": wide}
    )
    run_study(seen, tmp_path)
    assert store.read(tmp_path, "realisations").equals(before)
    assert stamps == [p.stat().st_mtime_ns for p in sorted((tmp_path / "realisations").glob("*"))]
    results = read_results(tmp_path)
    found = results.conditioning("base")
    assert found.usable
    told = store.read(tmp_path, "weights").to_pandas()
    np.testing.assert_allclose(told["weight"], found.weights)
    row = next(r for r in summary_rows(results) if r.metric == "tamping_interval_days")
    assert isinstance(row.conditioned_at(0.5), Estimate)
    names = {s.statistic for s in row.conditioned}
    assert {"conditioned_quantile", "conditioned_variance_share", "conditioned_line_mean"} <= names
    bands = {b.input: b for b in results.input_bands("base")}
    assert set(bands) == {N0["input"], LOAD["input"]}
    drawn = [m.values[LOAD["input"]] for m in all_sets(seen)]
    assert bands[LOAD["input"]].drawn[1] == np.sort(drawn)[3]
    run_study(plain, tmp_path)
    assert read_results(tmp_path).conditioning("base") is None


@pytest.mark.usefixtures("fresh_cache", "few_resamples")
def test_a_set_that_failed_leaves_the_numbers_of_the_others(tmp_path):
    wide = [{**entry, "sd_error_mm": 0.2} for entry in SDS]
    run = {"realisations": 12, "parameter_sets": 8, "history_days": [0, 10, 20, 40]}
    run_study(uncertain(N0, LOAD, observed=wide, run=run), tmp_path)
    whole = read_results(tmp_path)
    tables = {name: getattr(whole, name) for name in ("realisations", "effects", "weights")}
    lost = {
        name: table.assign(
            **{
                column: table[column].where(table["parameter_set"] != 2)
                for column in table.columns
                if column.endswith(("_days", "_1y_mm", "_likelihood"))
                or column in ("reduction_percent", "elasticity", "marginal_cost")
            }
        )
        for name, table in tables.items()
    }
    for name in ("realisations", "effects"):
        status = lost[name]["status"].astype(str)
        lost[name]["status"] = status.where(lost[name]["parameter_set"] != 2, "failed")
    fewer = {}
    for name, table in tables.items():
        kept = table[table["parameter_set"] != 2]
        number = kept["parameter_set"] - (kept["parameter_set"] > 2)
        fewer[name] = kept.assign(parameter_set=number)
    one, other = (
        {(row.scenario, row.metric): row for row in summary_rows(replace(whole, **found))}
        for found in (lost, fewer)
    )
    assert one.keys() == other.keys()
    assert ("v225", "marginal_cost") in one
    for key, row in one.items():
        assert row.conditioned_percent == pytest.approx(other[key].conditioned_percent)
        for part in ("statistics", "conditioned"):
            for mine, theirs in zip(getattr(row, part), getattr(other[key], part), strict=True):
                assert mine.statistic == theirs.statistic
                one_is, other_is = mine.estimate.value, theirs.estimate.value
                assert one_is == (other_is and pytest.approx(other_is, rel=1e-12)), key


def test_a_factor_of_another_variant_explains_nothing_of_this_one():
    fitted = {**FITTED, "input": "variants.b.settlement_factor"}
    study = uncertain(N0, fitted, observed=[INTERVAL], variants=[{"name": "a"}, {"name": "b"}])
    members = all_sets(study)
    table = pd.DataFrame({"parameter_set": np.repeat([m.index for m in members], 2)})
    for entry in (N0, fitted):
        table[input_column(entry["input"])] = np.repeat(
            [m.values[entry["input"]] for m in members], 2
        )
    paths, _ = _drawn(study, members, table.assign(variant="a"))
    assert paths == [N0["input"]]
    paths, drawn = _drawn(study, members, table.assign(variant="b"))
    assert paths == [N0["input"], fitted["input"]]
    np.testing.assert_array_equal(drawn[:, 0], [m.values[N0["input"]] for m in members])
    # What is fitted follows from the other inputs; its share of its own posterior does not.
    np.testing.assert_array_equal(drawn[:, 1], [m.shares[fitted["input"]] for m in members])
