"""A study with uncertain inputs end to end: what is shared, what is kept, what resumes."""

import numpy as np
import pandas as pd
import pytest
import toy
from toy import COST, LAW, LOAD, N0, SETS, SPRING, N, everything, table, uncertain

from mcsettle.errors import InputError
from mcsettle.railway.initial_profiles import InitialProfiles
from mcsettle.railway.scene import Scene
from mcsettle.run import compute
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.step_a import track_response, transfer_cache, transfers
from mcsettle.step_a.interaction import precompute
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.engine import engine_for
from mcsettle.storage import store
from mcsettle.study.parameter_sets import all_sets
from mcsettle.study.study import load_study
from mcsettle.study.transfer_store import transfer_store
from mcsettle.summary.results import Results, read_results
from mcsettle.summary.sign_split import sign_rows
from mcsettle.summary.summary import summary_rows, tonnage_rows

pytestmark = pytest.mark.usefixtures("fresh_cache", "few_resamples")
SHARD = 3  # two for each scenario


@pytest.fixture(scope="module")
def study():
    return uncertain(N0, LOAD, COST)


@pytest.fixture
def counted(monkeypatch):
    """Calls of Step A's dear part, and of Step B, by name."""
    calls = {"precompute": 0, "engine": 0, "response": 0}
    for key, owner, name in (
        ("precompute", transfer_cache, "precompute"),
        ("response", track_response, "beam_response"),
        ("engine", compute, "engine_for"),
    ):
        kept = getattr(owner, name)

        def wrapped(*arguments, _key=key, _kept=kept, **options):
            calls[_key] += 1
            return _kept(*arguments, **options)

        monkeypatch.setattr(owner, name, wrapped)
    return calls


def test_rows_are_those_of_each_sets_own_study(study, finished):
    """Every set against its study run alone, its Step A computed and not scaled."""
    rows = table(finished.folder, "realisations", "v225")
    assert len(rows) == SETS * N
    for member in all_sets(study):
        own = member.study
        service = own.timetable("v225").services[0]
        response = track_response.track_response(own.track(), 5.5)
        transfer = precompute(service.train, service.speed, response, own.wavenumbers)
        prepared = transfers.StepA({("base", "v225"): (transfer,)})
        days = engine_for(build_case(own.scene("base", "v225"), prepared)).run(
            own.initial_profiles().sample(range(N)), np.zeros(0)
        ).days  # fmt: skip
        part = rows[rows["parameter_set"] == member.index].sort_values("realisation")
        # Scaling the quasi-static stress and computing it anew differ in rounding.
        np.testing.assert_allclose(part["tamping_interval_days"], days, rtol=1e-6)
    assert rows.groupby("parameter_set")["tamping_interval_days"].mean().nunique() == SETS


def test_inputs_are_in_the_rows_and_in_their_table(study, finished):
    rows, drawn = table(finished.folder, "realisations"), store.read(finished.folder, "parameters")
    drawn = drawn.to_pandas()
    assert len(drawn) == SETS * 4
    for member in all_sets(study):
        part = rows[rows["parameter_set"] == member.index]
        for path, value in member.values.items():
            column = "input_" + path.replace(".", "_")
            assert set(part[column]) == {value}
            told = drawn[(drawn["parameter_set"] == member.index) & (drawn["input"] == path)]
            assert told["value"].tolist() == [value]
    units = dict(zip(drawn["input"], drawn["unit"], strict=True))
    assert units[LOAD["input"]] == "t"
    schema = store.read(finished.folder, "realisations").schema
    assert schema.field("input_trains_passenger_axle_load_t").metadata[b"unit"] == b"t"


def test_effects_take_each_sets_own_money(study, finished):
    rows = table(finished.folder, "realisations")
    keys = ["parameter_set", "realisation"]
    days = {s: g.set_index(keys)["tamping_interval_days"] for s, g in rows.groupby("scenario")}
    effects = table(finished.folder, "effects").set_index(keys).sort_index()
    ratio = (days["v225"] / days["v201"]).sort_index()
    np.testing.assert_allclose(effects["reduction_percent"], 100 * (1 - ratio), rtol=1e-9)
    cost = [m.study.economics.tamping_cost_per_track_km for m in all_sets(study)]
    gamma = (ratio - 1) / (24 / 201)
    slope = 0.035 / np.expm1(0.035 * days["v201"].sort_index() / 365)
    expected = -gamma * slope * np.repeat(cost, N) / (225 * 72 * 365 / 1000)
    np.testing.assert_allclose(effects["marginal_cost"], expected, rtol=1e-9)


def test_money_alone_shares_everything(tmp_path, counted):
    """Three sets that differ in money: Step A and Step B once, rows alike."""
    run_study(uncertain(COST, run={"realisations": 2, "parameter_sets": 3}), tmp_path)
    assert counted["engine"] == 2  # one for each scenario
    rows = table(tmp_path, "realisations", "v201")
    assert rows.groupby("realisation")["tamping_interval_days"].nunique().tolist() == [1, 1]
    assert table(tmp_path, "effects").groupby("realisation")["marginal_cost"].nunique().min() == 3


def test_step_b_inputs_and_axle_loads_cost_nothing_in_step_a(tmp_path, counted, monkeypatch):
    monkeypatch.setenv("MCSETTLE_CACHE", str(tmp_path / "cache"))
    few = {"realisations": 2, "parameter_sets": 3}
    run_study(uncertain(N0, LAW, LOAD, run=few), tmp_path / "out")
    assert counted["precompute"] == 2  # one for each speed
    assert counted["response"] == 1
    assert counted["engine"] == 6


def test_a_vehicle_input_costs_its_interaction_only(tmp_path, counted, monkeypatch):
    monkeypatch.setenv("MCSETTLE_CACHE", str(tmp_path / "cache"))
    run_study(uncertain(SPRING, run={"realisations": 2, "parameter_sets": 3}), tmp_path / "out")
    assert counted["precompute"] == 2 * (1 + 3)  # the central one and three sets
    assert counted["response"] == 1


def test_the_shelf_forgets_old_sets(study):
    shared_transfers, sizes = transfer_store(study), []
    for member in all_sets(study):
        transfers.step_a(member.study.scenes, store=shared_transfers)
        sizes.append(len(shared_transfers.transfers))
    assert max(sizes) <= 4  # the first set's two speeds and the last set's


def test_resuming_and_growing_change_no_byte(study, finished, tmp_path, small_shards, counted):
    run_study(study, tmp_path, RunOptions(realisations=2, parameter_sets=2))
    before = counted["engine"]
    assert before == 4
    run_study(study, tmp_path)
    assert everything(tmp_path) == everything(finished.folder)
    for kind in ("realisations", "history", "effects"):
        sorted((tmp_path / kind).glob("*.parquet"))[1].unlink()
    (tmp_path / "parameters" / "sets-000000-000003.parquet").unlink()
    run_study(study, tmp_path)
    assert everything(tmp_path) == everything(finished.folder)


def test_growing_goes_on_from_the_rows_that_are_there(study, tmp_path, monkeypatch):
    run_study(study, tmp_path, RunOptions(realisations=3))
    asked = []
    sample = InitialProfiles.sample

    def recorded(self, indices):
        asked.append(indices)
        return sample(self, indices)

    monkeypatch.setattr(InitialProfiles, "sample", recorded)
    run_study(study, tmp_path)
    # The last asks for all of them: the split of the effect, when the run is closed.
    assert set(asked) == {compute.CHECKED, range(3, N), range(N)}


def test_fewer_sets_than_held_are_refused(study, finished):
    with pytest.raises(InputError, match="holds 4 parameter sets and 3 are asked for"):
        run_study(study, finished.folder, RunOptions(parameter_sets=3))


def test_the_summary_is_a_table(finished):
    told = store.read(finished.folder, "summary").to_pandas()
    results = read_results(finished.folder)
    rows = [*summary_rows(results), *sign_rows(results)]
    assert len(told) == sum(len(r.statistics) + len(r.spread) for r in rows)
    own = told[(told["scenario"] == "v225") & (told["metric"] == "tamping_interval_days")]
    days = table(finished.folder, "realisations", "v225")["tamping_interval_days"]
    middle = own[(own["statistic"] == "quantile") & (own["level"] == 0.5)].iloc[0]
    assert middle["value"] == np.quantile(days, 0.5, method="inverted_cdf")
    assert (middle["n"], middle["unit"]) == (SETS * N, "d")
    assert middle["standard_error"] > 0
    shares = own[own["statistic"] == "variance_share"].set_index("subject")["value"]
    assert shares.sum() == pytest.approx(1.0)
    assert shares["parameters"] > 0.8  # N0 alone moves the days by a factor of five
    assert set(own[own["statistic"] == "line_mean"]["subject"]) == {
        "0.2 km",
        "1 km",
        "10 km",
        "100 km",
    }


def test_pairing_the_same_tracks_gains(finished):
    told = store.read(finished.folder, "summary").to_pandas().set_index("statistic")
    gain = told.loc["pairing_gain"]
    effects = table(finished.folder, "realisations")
    logs = np.log(
        effects.pivot(index=["parameter_set", "realisation"], columns="scenario",
                      values="tamping_interval_days")
    )  # fmt: skip
    within = logs - logs.groupby("parameter_set").transform("mean")
    paired = (within["v225"] - within["v201"]).var(ddof=0)
    assert gain["value"] == pytest.approx(within.var(ddof=0).sum() / paired)
    assert gain["value"] > 3


def test_a_line_costs_the_mean_of_its_sections(study, finished):
    told = store.read(finished.folder, "summary").to_pandas()
    costs = table(finished.folder, "effects")["marginal_cost"]
    own = told[told["metric"] == "marginal_cost"].set_index(["statistic", "subject"])["value"]
    assert own["section_mean", ""] == pytest.approx(costs.mean())
    rows = table(finished.folder, "realisations")
    days = rows.groupby(["scenario", "parameter_set"])["tamping_interval_days"].mean()
    at_mean = [
        -(days["v225", m.index] / days["v201", m.index] - 1)
        / (24 / 201)
        * m.study.economics.tamping_cost_per_track_km
        * 0.035
        / np.expm1(0.035 * days["v201", m.index] / 365)
        / (225 * 72 * 365 / 1000)
        for m in all_sets(study)
    ]
    assert own["cost_at_mean_interval", ""] == pytest.approx(np.mean(at_mean), rel=1e-9)
    assert own["cost_at_mean_interval", ""] < own["section_mean", ""]  # cost is convex
    long = told[(told["statistic"] == "line_mean") & (told["subject"] == "100 km")]
    long = long[(long["metric"] == "marginal_cost") & (long["level"] == 0.5)]
    by_set = table(finished.folder, "effects").groupby("parameter_set")["marginal_cost"].mean()
    assert by_set.min() < long["value"].iloc[0] < by_set.max()


@pytest.mark.parametrize("softens", [False, True])
def test_axle_loads_are_not_scaled_where_the_soil_softens(study, monkeypatch, softens):
    """There the load decides the ground, and nothing is in proportion to it."""
    given, response = [], track_response.track_response(study.track(), 5.5)
    kept = transfers.cached_transfer
    monkeypatch.setattr(transfers, "track_response", lambda *_: response)
    if softens:
        monkeypatch.setattr(Scene, "softened", lambda *_: "softened")
        monkeypatch.setattr(transfers, "section_settings", lambda *_, **__: None)

    def transfer(*arguments):
        given.append(arguments[5])  # the axle loads
        return kept(*arguments)

    monkeypatch.setattr(transfers, "cached_transfer", transfer)
    transfers.step_a(study.scenes, store=transfer_store(study))
    assert given == [{} if softens else {"passenger": 17e3}] * 2  # one for each speed


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ({"limit": {"sd_limit_mm": 1.4}}, False),
        ({"profile": {"sd_mm": 1.0}}, False),
        ({"settlement": {"ballast_cycles_before": 2e5}}, False),
        ({"track": {"layers": {"ballast": {"ballast_coefficient_per_mpa2": 0.4}}}}, False),
        ({"trains": {"passenger": {"vehicle": "passenger", "cars": 3, "axle_load_t": 16}}}, False),
        ({"seed": 2}, False),
        ({"run": {"stepping": "every_train"}}, False),
        ({"economics": {"discount_rate": 0.05}}, True),
        ({"title": "another"}, True),
    ],
    ids=str,
)
def test_what_shares_the_rows_of_step_b(change, same):
    keys = [s.step_b_key("base", "v201") for s in (toy.study(), toy.study(**change))]
    assert (keys[0] == keys[1]) == same


def test_the_increase_of_the_tonnage_stands_beside_the_published_one(root):
    """From the timetable: 1/72 of the passenger trains, 4000 t and 8000 t on 0.054 MGT a day."""
    study = load_study(root / "studies" / "traffic.toml")
    results = Results(study, *(pd.DataFrame() for _ in range(3)))
    effects = results.study.effects
    found = {s: next(tonnage_rows(results, "calibrated", effects[s])) for s in "BCD"}
    shown = {s: round(row.at(0.5).value, 1) for s, row in found.items()}
    assert shown == {"B": 1.4, "C": 7.4, "D": 14.8}
    assert all(row.reference.value == shown[s] for s, row in found.items())
    assert "A" not in effects


def test_growth_beyond_a_short_horizon_is_told_as_such(tmp_path):
    """A horizon of 30 days: nothing is known of day 365, and no limit came first."""
    short = toy.study(
        limit={"horizon_years": 30 / 365}, run={"realisations": 3, "history_days": [0, 5]}
    )
    run_study(short, tmp_path)
    rows = summary_rows(read_results(tmp_path))
    growth = next(row for row in rows if row.metric == "sd_growth_1y_mm")
    assert growth.at(0.5).note == "the horizon comes before day 365"
