"""A study end to end: tables, effects, resuming, growing, refusing."""

import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
import toy
from toy import everything, table

from mcsettle.errors import InputError
from mcsettle.run import compute
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.step_a import critical_speed
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.engine import engine_for
from mcsettle.storage import manifest
from mcsettle.storage.shard_name import shard_name
from mcsettle.study.study import load_study, resolved_toml

pytestmark = pytest.mark.usefixtures("fresh_cache")
SHARD = 4  # two for each scenario
N = 6


def test_every_file_is_there_and_whole(finished):
    assert finished.n_failed == 0
    assert finished.remarks == ()
    names = set(everything(finished.folder))
    shards = {
        shard_name("base", scenario, first, last)
        for scenario in ("v201", "v225")
        for first, last in ((0, 3), (4, 5))
    }
    for kind in ("realisations", "history"):
        assert {n.split("/")[1] for n in names if n.startswith(kind + "/")} == shards
    assert {n for n in names if n.startswith("effects/")} == {
        f"effects/{s}" for s in shards if "v225" in s
    }
    assert (
        manifest.verify(finished.folder) == len([n for n in names if n[0] != "."]) - 1
    )  # but itself
    assert {"study.toml", "provenance.json", "data_dictionary.csv", "manifest.json"} <= names


def test_rows_are_what_the_engine_says(study, finished):
    prepared = step_a(study.scenes)
    for scenario in study.scenario_names:
        case = build_case(study.scene("base", scenario), prepared)
        outcome = engine_for(case).run(study.initial_profiles().sample(range(N)), study.sample_days)
        rows = table(finished.folder, "realisations", scenario)
        assert rows["realisation"].tolist() == list(range(N))
        assert rows["status"].tolist() == ["reached"] * N
        np.testing.assert_array_equal(rows["tamping_interval_days"], outcome.days)
        np.testing.assert_array_equal(rows["passages"], outcome.passages)
        np.testing.assert_allclose(rows["sd_initial_mm"], 1.03, rtol=1e-12)
        np.testing.assert_allclose(rows["sd_final_mm"], 1.5, rtol=1e-6)
        np.testing.assert_allclose(rows["mean_settlement_mm"], outcome.mean_settlement * 1e3)
        # 12 axles of 17 t a train, 72 trains a day
        mass = rows["passages"] * 17e3
        np.testing.assert_allclose(rows["tonnage_mgt"], mass / 1e9, rtol=1e-12)
        assert rows["censored_at_days"].isna().all()
        assert rows["sd_growth_1y_mm"].isna().all()  # tamped long before a year
        assert rows["failure"].isna().all()
        history = table(finished.folder, "history", scenario)
        for r, own in history.groupby("realisation"):
            np.testing.assert_array_equal(own["day"].iloc[-1], outcome.days[r])
            before = study.sample_days[study.sample_days < outcome.days[r]]
            np.testing.assert_array_equal(own["day"].iloc[:-1], before)
            expected = [*outcome.history[r, : len(before)], outcome.sd_final[r]]
            np.testing.assert_allclose(own["sd_mm"], np.array(expected) * 1e3, rtol=1e-14)


def test_effects_follow_from_the_realisations(study, finished):
    base = table(finished.folder, "realisations", "v201")["tamping_interval_days"].to_numpy()
    other = table(finished.folder, "realisations", "v225")["tamping_interval_days"].to_numpy()
    rows = table(finished.folder, "effects")
    assert rows["realisation"].tolist() == list(range(N))
    assert set(rows["status"]) == {"paired"}
    assert set(rows["baseline"]) == {"v201"}
    assert set(rows["effect"]) == {"speed"}
    np.testing.assert_allclose(rows["reduction_percent"], 100 * (1 - other / base), rtol=1e-12)
    elasticity = (other / base - 1) / (24 / 201)
    np.testing.assert_allclose(rows["elasticity"], elasticity, rtol=1e-12)
    # Eq. (8) from the study's own 72 × 365 trains a year
    slope = 5625 * 0.035 / np.expm1(0.035 * base / 365)
    cost = -elasticity * slope / (225 * 72 * 365 / 1000)
    np.testing.assert_allclose(rows["marginal_cost"], cost, rtol=1e-12)
    assert len(np.unique(elasticity)) == N


def test_units_and_provenance_are_in_the_files(study, finished):
    path = next((finished.folder / "realisations").glob("*v225*-00000005.parquet"))
    schema = pq.read_schema(path)
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert units["tamping_interval_days"] == "d"
    assert units["sd_final_mm"] == "mm"
    assert units["tonnage_mgt"] == "MGT"
    stored = {k.decode(): v.decode() for k, v in schema.metadata.items()}
    assert stored["study_digest"] == study.digest
    assert stored["transfer_digest"] == step_a(study.scenes).digest
    assert stored["seed"] == str(study.seed)
    assert stored["index_range"] == "4-5"


def test_the_study_can_be_read_back(study, finished):
    again = load_study(finished.folder / "study.toml")
    assert again == study
    assert resolved_toml(again) == resolved_toml(study)


@pytest.mark.parametrize("batch", [1, 3, None])
def test_batches_change_no_byte(study, finished, batch, tmp_path, small_shards):
    assert everything(run_study(study, tmp_path, RunOptions(batch=batch)).folder) == everything(
        finished.folder
    )


@pytest.mark.parametrize("kind", ["realisations", "history", "effects"])
def test_resuming_changes_no_byte(study, finished, kind, tmp_path, small_shards):
    """A shard is lost, another is cut short as by a crash: both are made again, nothing else."""
    run_study(study, tmp_path)
    first, second, *_ = sorted((tmp_path / kind).glob("*.parquet"))
    first.unlink()
    second.write_bytes(second.read_bytes()[:100])
    (tmp_path / "manifest.json").unlink()
    if kind != "effects":
        kept = (tmp_path / "realisations" / shard_name("base", "v225", 4, 5)).stat()
    run_study(study, tmp_path)
    assert everything(tmp_path) == everything(finished.folder)
    if kind != "effects":
        now = (tmp_path / "realisations" / shard_name("base", "v225", 4, 5)).stat()
        assert now.st_mtime_ns == kept.st_mtime_ns


def test_a_finished_run_is_not_repeated(study, finished, monkeypatch, small_shards):
    def refuse(*_, **__):
        raise AssertionError("nothing is left to do")

    monkeypatch.setattr(compute, "engine_for", refuse)
    before = everything(finished.folder)
    run_study(study, finished.folder)
    assert everything(finished.folder) == before


def test_growing_keeps_what_was_and_leaves_no_old_shard(study, finished, tmp_path, small_shards):
    run_study(study, tmp_path, RunOptions(realisations=3))
    before = table(tmp_path, "realisations")
    run_study(study, tmp_path, RunOptions(realisations=N))
    after = table(tmp_path, "realisations")
    assert len(after) == 2 * N
    same = after[after["realisation"] < 3].reset_index(drop=True)
    assert same.equals(before)
    assert everything(tmp_path) == everything(finished.folder)


def test_fewer_realisations_than_held_are_refused(study, tmp_path, small_shards):
    run_study(study, tmp_path, RunOptions(realisations=5))
    before = everything(tmp_path)
    with pytest.raises(InputError, match="holds 5 realisations and 4 are asked for"):
        run_study(study, tmp_path, RunOptions(realisations=4))
    assert everything(tmp_path) == before


@pytest.mark.parametrize(
    "other",
    [{"seed": 2}, {"limit": {"sd_limit_mm": 1.4}}, {"run": {"stepping": "every_train"}}],
)
def test_a_folder_of_another_study_is_left_alone(finished, other):
    before = everything(finished.folder)
    with pytest.raises(InputError, match="give another folder"):
        run_study(toy.study(**{"run": {"realisations": N}, **other}), finished.folder)
    assert everything(finished.folder) == before


def test_a_folder_of_something_else_is_left_alone(study, tmp_path):
    (tmp_path / "provenance.json").write_text("{}", encoding="utf-8")
    (tmp_path / "precious.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="damaged"):
        run_study(study, tmp_path)
    assert set(everything(tmp_path)) == {"provenance.json", "precious.txt"}


def test_an_unwritable_folder_is_refused(study, tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be written"):
        run_study(study, tmp_path / "file" / "results")


def test_titles_and_economics_free_studies(tmp_path):
    """Without [economics] there are no effects, and nothing else is missing."""
    study = toy.study(run={"realisations": 2})
    bare = study.model_copy(update={"economics": None})
    run_study(bare, tmp_path)
    assert len(table(tmp_path, "realisations")) == 4
    assert not (tmp_path / "effects").exists()


def test_out_of_time_rows_are_censored(tmp_path):
    """The horizon falls between the tracks: rows without days, effects without numbers."""
    horizon = 57.5 / 365  # the limit comes after 37 to 104 days
    study = toy.study(run={"realisations": 12}, limit={"horizon_years": horizon})
    run_study(study, tmp_path)
    rows = table(tmp_path, "realisations")
    late = rows["status"] == "censored"
    assert 2 < late.sum() < 22
    assert rows.loc[late, "tamping_interval_days"].isna().all()
    np.testing.assert_allclose(rows.loc[late, "censored_at_days"], 57.5)
    np.testing.assert_array_equal(rows.loc[late, "passages"], round(57.5 * 864))
    assert (rows.loc[late, "sd_final_mm"] < 1.5).all()
    assert rows.loc[~late, "censored_at_days"].isna().all()
    assert set(rows.loc[~late, "status"]) == {"reached"}
    effects = table(tmp_path, "effects")
    either = late.to_numpy().reshape(2, 12).any(axis=0)
    assert either.any()
    assert not either.all()
    np.testing.assert_array_equal(effects["status"] == "censored", either)
    assert (
        effects.loc[either, ["reduction_percent", "elasticity", "marginal_cost"]]
        .isna()
        .all(axis=None)
    )


def test_growth_in_a_year(tmp_path):
    study = toy.study(run={"realisations": 2}, settlement={"settlement_factor": 10})
    run_study(study, tmp_path)
    rows, history = table(tmp_path, "realisations"), table(tmp_path, "history")
    year = history[history["day"] == 365.0]["sd_mm"].to_numpy()
    np.testing.assert_allclose(rows["sd_growth_1y_mm"], year - 1.03, rtol=1e-9)
    assert (rows["sd_growth_1y_mm"] > 0).all()


def test_exact_runs_every_axle(tmp_path):
    """The same days to 0.2 %, here some three of them; the study kept beside them says so."""
    study = toy.study(settlement={"settlement_factor": 3000})
    run_study(study, tmp_path, RunOptions(realisations=2, exact=True))
    rows = table(tmp_path, "realisations", "v201")
    case = build_case(study.scene("base", "v201"), step_a(study.scenes))
    jump = engine_for(case).run(study.initial_profiles().sample(range(2)), np.zeros(0))
    np.testing.assert_allclose(rows["tamping_interval_days"], jump.days, rtol=2e-3)
    np.testing.assert_allclose(rows["tamping_interval_days"] * 864, rows["passages"], rtol=1e-12)
    assert load_study(tmp_path / "study.toml").run.stepping == "every_axle"


def test_variants_stand_beside_each_other(tmp_path):
    variants = [{"name": "traffic"}, {"name": "total", "stress": "total"}]
    study = toy.study(variants=variants, run={"realisations": 2})
    run_study(study, tmp_path)
    rows = table(tmp_path, "realisations").groupby("variant")["tamping_interval_days"].mean()
    assert rows["total"] < rows["traffic"]
    effects = table(tmp_path, "effects")
    assert effects.groupby("variant").size().to_dict() == {"traffic": 2, "total": 2}


def test_more_of_the_same_trains_is_the_identity_of_traffic(tmp_path):
    """73 trains for 72: elasticity −72/73 in every realisation, whatever the track."""
    data = {
        "economics": {"effect": "tonnage", "baseline": "A"},
        "scenarios": [
            {"name": name, "timetable": [{"train": "passenger", "speed_kmh": 201, "per_day": n}]}
            for name, n in (("A", 72), ("B", 73))
        ],
    }
    study = toy.study(**data)
    run_study(study, tmp_path)
    np.testing.assert_allclose(table(tmp_path, "effects")["elasticity"], -72 / 73, atol=1e-4)


def test_trains_near_the_critical_speed_are_remarked_on(study, finished, tmp_path, monkeypatch):
    fast = max(s.speed for name in study.scenario_names for s in study.timetable(name).services)
    assert not any("critical" in remark for remark in finished.remarks)
    monkeypatch.setattr(critical_speed, "critical_speed_of", lambda response: fast / 0.81)
    monkeypatch.setattr(critical_speed, "lowest_critical_speed", lambda response: 0.0)
    told = run_study(study.with_run(realisations=1), tmp_path).remarks
    assert [remark for remark in told if "critical" in remark] == [
        "passenger, 225 km/h: 81% of the critical speed of track and ground (278 km/h)"
    ]


def test_failed_rows_are_told_and_kept(study, tmp_path, monkeypatch):
    """A track that overflows is a row with a reason, and its effect is failed, not missing."""
    run = CycleJump.run

    def broken(self, *arguments, **options):
        outcome = run(self, *arguments, **options)
        second = np.arange(3) == 1
        return replace(
            outcome,
            failed=second,
            reached=outcome.reached & ~second,
            days=np.where(second, np.nan, outcome.days),
        )

    monkeypatch.setattr(CycleJump, "run", broken)
    finished = run_study(study, tmp_path, RunOptions(realisations=3))
    assert finished.n_failed == 2
    rows = table(tmp_path, "realisations", "v225")
    assert rows["status"].tolist() == ["reached", "failed", "reached"]
    assert rows["failure"].notna().tolist() == [False, True, False]
    assert rows["censored_at_days"].isna().all()
    assert table(tmp_path, "effects")["status"].tolist() == ["paired", "failed", "paired"]


def test_a_crude_expansion_falls_back_to_every_x_and_depth(tmp_path):
    """Very rough track: the second-order form is off by more than 0.3 %; the run says what it did."""
    rough = {"profile": {"sd_mm": 30.0}, "limit": {"sd_limit_mm": 31.0}}
    remarks = run_study(toy.study(**rough, run={"realisations": 2}), tmp_path / "a").remarks
    assert len(remarks) == 2
    assert 'right_hand_side = "pointwise"' in remarks[0]
    asked = toy.study(**rough, run={"realisations": 2, "right_hand_side": "pointwise"})
    assert not run_study(asked, tmp_path / "b").remarks
    fallen, wanted = (
        table(tmp_path / part, "realisations", "v225")["tamping_interval_days"] for part in "ab"
    )
    np.testing.assert_array_equal(fallen, wanted)


def test_a_crude_expansion_with_nothing_to_fall_back_to_is_refused(tmp_path):
    study = toy.study(
        profile={"sd_mm": 30.0},
        limit={"sd_limit_mm": 31.0},
        run={"realisations": 2, "stepping": "every_train"},
    )
    with pytest.raises(InputError, match=r"off by .* every x and depth instead takes"):
        run_study(study, tmp_path)


def test_progress_covers_both_steps(tmp_path, fresh_cache, monkeypatch):
    monkeypatch.setenv("MCSETTLE_CACHE", str(tmp_path / "cache"))
    seen = []
    options = RunOptions(realisations=2)
    run_study(toy.study(), tmp_path / "out", options, lambda *now: seen.append(now))
    texts = {text for text, _, _ in seen}
    assert any(text.startswith("Step A") for text in texts)
    assert "Step B: base v225" in texts
    assert all(0 <= done <= total for _, done, total in seen)


def test_a_damaged_transfer_file_is_made_again(study, fresh_cache):
    first = step_a(study.scenes)
    path = sorted(fresh_cache.glob("transfer-*.npz"))[0]
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    told = []
    again = step_a(study.scenes, lambda text, *_: told.append(text))
    assert any("damaged" in text for text in told)
    assert again.digest == first.digest
    assert path.read_bytes() == whole


def test_manifest_is_plain(finished):
    manifest = json.loads((finished.folder / "manifest.json").read_text(encoding="utf-8"))
    rows = sum(f["rows"] for f in manifest["files"] if f["path"].startswith("realisations/"))
    assert rows == 2 * N
    assert manifest["provenance"]["lanes"] == 32
