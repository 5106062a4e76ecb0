"""Many possible grounds: reading, slabs, failures with reasons, runs that go on, reports by segment."""

import json
from pathlib import Path

import made_run
import numpy as np
import pandas as pd
import pytest
import toy
from toy_grounds import LAYERS, MATERIALS, WEIGHTS, soil, study
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.errors import InputError
from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.weighted_quantiles import weighted_quantiles
from mcsettle.railway.ground_profiles import Columns, read_grounds, slab_materials, slabs
from mcsettle.run.options import RunOptions
from mcsettle.study.parameter_sets import all_sets
from mcsettle.study.study import load_study, resolved_toml
from mcsettle.summary.samples import interval_sample
from mcsettle.summary.segments import ground_report
from mcsettle.summary.spread import interval_spread

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "layers.csv").write_text("\ufeff" + LAYERS, encoding="utf-8")
    (tmp_path / "weights.csv").write_text(WEIGHTS, encoding="utf-8")
    return tmp_path


def test_grounds_are_read_ranked_and_cut(folder: Path) -> None:
    grounds = read_grounds(folder / "layers.csv", folder / "weights.csv", Columns(), ("raise",))
    assert [g.name for g in grounds] == ["A1", "B1", "A2"]
    assert [g.probability for g in grounds] == [0.7, 1.0, 0.3]
    assert grounds[0].tops == (0.0, 2.0, 7.0)
    heights = slabs(1.0, 3.0, 2.0, 7.0)
    assert heights == (1.0, 1.0, 1.0, 2.0, 2.0)
    assert slab_materials(grounds[0], heights) == ("fill", "fill", "clay", "clay", "clay", "sand")
    assert slab_materials(grounds[2], heights)[:3] == ("fill", "peat", "sand")


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("weights", "A1;70", "A1;60", "'A' add up to 90, not 100"),
        ("weights", "A1;70", "A1;x", "probability is 'x'; it must be a number"),
        ("weights", "B;B1", "B;C9", "ground 'C9' has no layers"),
        ("weights", "A;A2;30", "A;A1;30", "comes a second time"),
        ("weights", "segment_id", "segment", "has no column segment_id"),
        ("layers", "A1;1.0;clay", "A1;9.0;clay", "levels of ground 'A1' do not fall"),
        ("layers", "A1;1.0", "A1;nan", "top_level is 'nan'"),
        ("layers", "B1;1.0;fill;\nB1;0.5;sand;\n", "", "nothing is left of ground 'B1'"),
    ],
)
def test_what_cannot_be_is_refused(folder: Path, name: str, old: str, new: str, said: str) -> None:
    path = folder / f"{name}.csv"
    text = path.read_text(encoding="utf-8-sig")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        all_sets(study(folder))


def test_each_ground_is_a_parameter_set_and_peat_fails_with_its_reason(folder: Path) -> None:
    sets = all_sets(study(folder))
    assert [m.values["ground.probability"] for m in sets] == [0.7, 1.0, 0.3]
    assert [m.values["ground.segment"] for m in sets] == [1.0, 2.0, 1.0]
    assert sets[0].failure == sets[1].failure == ""
    track = sets[0].study.track()
    assert [w.material.youngs_modulus for w in track.layers[2:8]] == [1e8] * 4 + [4e7] * 2
    assert np.isinf(track.layers[-1].height)
    assert "no settlement law for 'peat' (peat), 1 m below" in sets[2].failure
    assert "settlement_a" in sets[2].failure
    shallow = all_sets(study(folder, materials={k: v for k, v in MATERIALS.items() if k != "peat"}))
    assert "'peat' is not in [grounds.materials]" in shallow[2].failure
    # The user supplies it.
    given = {**MATERIALS, "peat": soil(8e6, settlement_a=3.0)}
    assert not any(member.failure for member in all_sets(study(folder, materials=given)))


def test_the_digest_is_that_of_the_files_content(folder: Path) -> None:
    first = study(folder)
    assert first.nested
    assert first.n_sets == 3
    assert first.with_run(parameter_sets=2).n_sets == 2
    (folder / "weights.csv").write_text(WEIGHTS.replace("70", "60").replace("30", "40"))
    assert study(folder).digest != first.digest
    with pytest.raises(InputError, match="leads out of the study's folder"):
        study(folder, layers="../layers.csv")
    with pytest.raises(InputError, match=r"grounds.weights: .*does not exist"):
        study(folder, weights="none.csv")


@pytest.mark.usefixtures("fresh_cache", "few_resamples")
def test_a_run_goes_on_and_reports_by_segment(folder: Path) -> None:
    from mcsettle import run_study
    from mcsettle.storage.store import read
    from mcsettle.summary.results import read_results
    from mcsettle.summary.summary import summary_rows

    out = folder / "out"
    own = study(folder)
    first = run_study(own, out, RunOptions(parameter_sets=2))
    assert first.n_failed == 0
    finished = run_study(own, out)
    assert finished.n_failed == 2 * 4  # one ground, two scenarios, four tracks
    whole = run_study(own, folder / "whole")
    assert whole.n_failed == finished.n_failed
    table, other = (read(p, "realisations").to_pandas() for p in (out, folder / "whole"))
    keys = ["scenario", "parameter_set", "realisation"]
    table, other = (t.sort_values(keys).reset_index(drop=True) for t in (table, other))
    assert table.equals(other)
    failed = table[table["status"] == "failed"]
    assert set(failed["parameter_set"]) == {2}
    assert failed["failure"].str.contains("no settlement law for 'peat'").all()
    # The folder stands alone: files beside the study are in it.
    assert summary_rows(read_results(out))
    for key in ("layers", "weights"):
        name = f"{key}.csv"
        assert (out / "inputs" / f"grounds.{key}" / name).read_bytes() == (
            folder / name
        ).read_bytes()

    report = ground_report(out)
    rows = {row.segment: row for row in report.rows}
    assert rows["A"].known == pytest.approx(0.7)
    assert rows["B"].known == pytest.approx(1.0)
    assert report.line.known == pytest.approx(0.85)
    base = table[(table["scenario"] == "v201") & (table["parameter_set"] == 0)]
    days = base["tamping_interval_days"].to_numpy(float)
    assert rows["A"].days == tuple(weighted_quantiles(days, np.ones(4), LEVELS))
    assert rows["A"].failed == 1
    assert np.isnan(rows["A"].marginal)
    assert np.isfinite(ground_report(out, scenario="v225").line.marginal)

    path = folder / "study.toml"
    path.write_text(resolved_toml(own), encoding="utf-8")
    runner = CliRunner()
    listed = runner.invoke(app, ["grounds", str(path)])
    assert listed.exit_code == 0, listed.stderr
    assert "3 grounds; 1 of the 3 asked for cannot be run" in listed.stdout
    picture = folder / "line.png"
    shown = runner.invoke(
        app, ["grounds", str(path), "--results", str(out), "--picture", str(picture)]
    )
    assert shown.exit_code == 0, shown.stderr
    assert "failed: ground 'A2'" in shown.stdout
    assert picture.stat().st_size > 10_000
    told = runner.invoke(app, ["grounds", str(path), "--results", str(out), "--json"])
    assert json.loads(told.stdout)["line"]["known_probability"] == pytest.approx(0.85)


def test_a_run_without_grounds_is_refused(tmp_path: Path) -> None:
    days = np.linspace(500.0, 900.0, 5)
    folder = made_run.write(tmp_path / "run", made_run.study(), {"v201": days, "v225": days})
    with pytest.raises(InputError, match=r"without \[grounds\]"):
        ground_report(folder)


def test_the_spread_over_grounds_leaves_out_those_that_failed() -> None:
    n_sets, n_tracks, lost = 40, 6, 5
    rng = np.random.default_rng(3)
    days = np.exp(rng.normal(6.0, 1.0, (n_sets, 1)) + rng.normal(0.0, 0.5, n_tracks))
    days[lost] = np.nan
    table = pd.DataFrame(
        {
            "variant": "base",
            "parameter_set": np.repeat(np.arange(n_sets), n_tracks),
            "realisation": np.tile(np.arange(n_tracks), n_sets),
            "tamping_interval_days": days.ravel(),
            "censored_at_days": np.where(np.isnan(days), np.nan, 18_250.0).ravel(),
        }
    )
    own = toy.study()
    found = interval_spread(own, all_sets(own), table, interval_sample(table))
    shares = {s.subject: s.estimate for s in found if s.statistic == "variance_share"}
    assert sum(e.value for e in shares.values()) == pytest.approx(1.0)
    assert {e.n for e in shares.values()} == {(n_sets - 1) * n_tracks}
    assert not any(s.statistic.endswith("_index") for s in found)


def test_the_dutch_study_is_sound_and_says_what_fails() -> None:
    own = load_study(ROOT / "studies" / "prorail.toml")
    sets = all_sets(own)
    assert len(sets) == 433
    first = sets[:90]  # the likeliest ground of every segment
    assert len({m.values["ground.segment"] for m in first}) == 90
    failed = [m for m in sets if m.failure]
    assert len(failed) == 143
    assert all("no settlement law for" in m.failure for m in failed)
    sound = {len(m.study.track().layers) for m in sets if not m.failure}
    assert len(sound) == 1  # one mesh
    table = own.grounds_table
    assert table is not None
    for code, material in table.materials.items():
        assert material.source or material.no_law, code
    total = sum(m.values["ground.probability"] for m in sets)
    assert total == pytest.approx(90.0)
