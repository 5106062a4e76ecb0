"""A line from recordings: several dates, tracks and files, what differs along it, where it grows."""

import json
from datetime import date, timedelta

import numpy as np
import pytest
import toy
from typer.testing import CliRunner

from mcsettle.analysis.growth_courses import SteppedGrowth
from mcsettle.cli.app import app
from mcsettle.railway.irregularity import sample_profiles, to_space, wavenumbers
from mcsettle.railway.spectra import spectrum
from mcsettle.step_a.transfers import step_a
from mcsettle.study.build_line import build_line
from mcsettle.study.study import Study, load_study, resolved_toml

pytestmark = pytest.mark.usefixtures("fresh_cache")
LENGTH, STEP, N = 1200.0, 0.5, 6
X = np.arange(0.0, LENGTH, STEP)
DAYS = (0, 100, 200)


def level(seed: int) -> np.ndarray:
    """Level [N] m of waves from 2 to 60 m."""
    k = wavenumbers(LENGTH, 2.0, 60.0)
    waves = sample_profiles(spectrum("fra", 6), k, LENGTH, seed, [0], sd=0.6e-3)
    return to_space(waves, k, X)[0]


def write(path, values: np.ndarray, start: float = 0.0, shift: float = 0.0) -> None:
    rows = [f"{x + start + shift:.3f},{1e3 * z:.5f}" for x, z in zip(X, values, strict=True)]
    path.write_text("\n".join(["chainage_m,level_mm", *rows]), encoding="utf-8")


def line_of(folder, seed: int, name: str, start: float = 0.0, shift: float = 2.0) -> list[dict]:
    """Runs whose hollows deepen by 8 % a time, with a little that is new; the car's chainage is off."""
    before, runs = level(seed), []
    for number, day in enumerate(DAYS):
        now = before * (1.0 + 0.08 * number) + 0.02 * number * level(seed + 50)
        write(folder / f"{name}{number}.csv", now, start, shift * (number == 1))
        when = date(2024, 1, 1) + timedelta(days=day)
        runs.append({"file": f"{name}{number}.csv", "date": when.isoformat()})
    return runs


def study_of(folder, **line) -> Study:
    variants = [{"name": "base"}, {"name": "weak", "settlement_factor": 40.0}]
    study = toy.study(
        profile={"shortest_m": 3.0},
        variants=variants,
        line={"sd_error_mm": 0.02, "scenario": "v201", **line},
    )
    path = folder / "study.toml"
    path.write_text(resolved_toml(study), encoding="utf-8")
    return load_study(path)


def told(folder) -> dict:
    done = CliRunner().invoke(app, ["sections", str(folder / "study.toml"), "--json"])
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout)


def test_growth_by_wavelength_stands_beside_the_model(tmp_path):
    study_of(tmp_path, runs=line_of(tmp_path, 1, "a"))
    found = told(tmp_path)
    assert len(found["sections"]) == N
    bands = found["increments"]
    assert [b["longest_m"] for b in bands[:-1]] == [b["shortest_m"] for b in bands[1:]]
    assert bands[0]["shortest_m"] == pytest.approx(3.0, abs=0.1)
    for band in bands:  # written so: 16 %, and 4 % that is new
        assert band["growth"] == pytest.approx(np.hypot(0.16, 0.04), rel=0.25)
        assert band["correlation"] > 0.8
        assert band["model_growth"] > 0.0
        assert -1.0 <= band["model_correlation"] <= 1.0


def test_limit_traffic_support_and_exclusions_differ_along_the_line(tmp_path):
    stretches = [
        {"chainage_from_m": 0, "chainage_to_m": 400, "sd_limit_mm": 1.1},
        {"chainage_from_m": 400, "chainage_to_m": 800, "scenario": "v225", "variant": "weak"},
        {"chainage_from_m": 800, "chainage_to_m": 1000, "exclude": "switch"},
    ]
    study_of(tmp_path, runs=line_of(tmp_path, 2, "a"), stretches=stretches)
    rows = {row["chainage_from_m"]: row for row in told(tmp_path)["sections"]}
    assert sorted(rows) == pytest.approx([0, 200, 400, 600, 1000])
    assert [rows[x]["sd_limit_mm"] for x in sorted(rows)] == [1.1, 1.1, 1.5, 1.5, 1.5]
    assert [rows[x]["scenario"] for x in sorted(rows)] == ["v201", "v201", "v225", "v225", "v201"]
    assert [rows[x]["variant"] for x in sorted(rows)] == ["base", "base", "weak", "weak", "base"]


def test_several_tracks_and_files_of_one_line(tmp_path):
    """Two files one behind the other, a second track beside them; tampings and limits by track."""
    runs = [
        *({**run, "track": "up"} for run in line_of(tmp_path, 3, "a")),
        *({**run, "track": "up"} for run in line_of(tmp_path, 4, "b", start=LENGTH)),
        *({**run, "track": "down"} for run in line_of(tmp_path, 5, "c")),
    ]
    line = {
        "runs": runs,
        "stretches": [
            {"chainage_from_m": 0, "chainage_to_m": 600, "track": "down", "sd_limit_mm": 0.1}
        ],
    }
    study_of(tmp_path, **line)
    picture = tmp_path / "s.svg"
    call = ["sections", str(tmp_path / "study.toml"), "--json", "--picture", str(picture)]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    rows = {(row["track"], round(row["chainage_from_m"])): row for row in found["sections"]}
    up = {("up", 200 * i) for i in range(2 * N)}
    assert set(rows) == up | {("down", 200 * i) for i in range(N)}
    assert {row["runs"] for row in rows.values()} <= {2, 3}  # a shift may cost an end
    assert {key for key, row in rows.items() if row["beyond_limit"]} == {
        ("down", 0), ("down", 200), ("down", 400)
    }  # fmt: skip
    assert {site["track"] for site in found["worksites"]} <= {"up", "down"}
    assert any(site["track"] == "down" for site in found["worksites"])
    assert picture.stat().st_size > 0


def test_a_track_that_no_run_is_of_is_refused(tmp_path):
    stretch = {"chainage_from_m": 0, "chainage_to_m": 600, "track": "left", "exclude": "bridge"}
    study_of(tmp_path, runs=line_of(tmp_path, 6, "a"), stretches=[stretch])
    done = CliRunner().invoke(app, ["sections", str(tmp_path / "study.toml")])
    assert done.exit_code == 2
    assert "'left'" in done.stderr


def test_faults_of_all_files_are_said_at_once(tmp_path):
    study_of(tmp_path, runs=line_of(tmp_path, 7, "a"))
    for number in (0, 2):
        (tmp_path / f"a{number}.csv").write_text(
            "chainage_m,level_mm\n1,x\n2,y\n", encoding="utf-8"
        )
    done = CliRunner().invoke(app, ["sections", str(tmp_path / "study.toml")])
    assert done.exit_code == 2
    assert "a0.csv" in done.stderr
    assert "a2.csv" in done.stderr


def test_support_that_varies_along_the_track_is_in_the_forecast(tmp_path):
    """Fields of 20 %: Step B carries other SDs on; one that persists is the same after a tamping."""
    tamped = [{"chainage_from_m": 0, "chainage_to_m": LENGTH, "date": "2024-02-01"}]
    runs, sds = line_of(tmp_path, 8, "a"), {}
    for name, field in {
        "none": {"cov": 0.0, "correlation_length_m": 5.0},
        "same": {"cov": 0.2, "correlation_length_m": 5.0},
        "other": {"cov": 0.2, "correlation_length_m": 5.0, "persistence": 0.0},
    }.items():
        variants = [{"name": "base", "spatial_variability": field}]
        line = {"runs": runs, "tampings": tamped, "sd_error_mm": 0.02, "scenario": "v201"}
        study = Study.from_mapping(
            toy.study(variants=variants, line=line).model_dump(by_alias=True, exclude_none=True),
            folder=tmp_path,
        )
        history, scene = build_line(study).history, study.scene("base", "v201")
        growth = SteppedGrowth({("base", "v201"): scene}, step_a([scene]), history)
        rows = np.arange(1, 3)
        sds[name] = [growth.courses(rows, run, 60.0).on(np.full(2, 30.0)) for run in (0, 1)]
    for run in (0, 1):
        finite = np.isfinite(sds["none"][run]) & np.isfinite(sds["same"][run])
        assert not np.allclose(sds["none"][run][finite], sds["same"][run][finite], rtol=1e-3)
    np.testing.assert_array_equal(sds["same"][0], sds["other"][0])
    finite = np.isfinite(sds["same"][1]) & np.isfinite(sds["other"][1])
    assert not np.allclose(sds["same"][1][finite], sds["other"][1][finite], rtol=1e-3)


def test_a_field_coherent_with_a_recorded_profile_is_refused(tmp_path):
    field = {"cov": 0.2, "correlation_length_m": 5.0, "profile_correlation": 0.5}
    line = {"runs": line_of(tmp_path, 9, "a"), "sd_error_mm": 0.02, "scenario": "v201"}
    study = toy.study(spatial_variability=field, line=line)
    (tmp_path / "study.toml").write_text(resolved_toml(study), encoding="utf-8")
    done = CliRunner().invoke(app, ["sections", str(tmp_path / "study.toml")])
    assert done.exit_code == 2
    assert "profile_correlation" in done.stderr


def test_a_tamping_is_of_its_track_alone(tmp_path):
    """Of the two tracks beside one another one was tamped; its SDs alone begin a new span."""
    runs = [
        *({**run, "track": "up"} for run in line_of(tmp_path, 10, "a", shift=0.0)),
        *({**run, "track": "down"} for run in line_of(tmp_path, 11, "b", shift=0.0)),
    ]
    own = {"chainage_from_m": 0, "chainage_to_m": 600, "date": "2024-02-01"}
    spans = {}
    for track in ("down", None):
        tamping = own | ({"track": track} if track else {})
        history = build_line(study_of(tmp_path, runs=runs, tampings=[tamping])).history
        spans[track] = {
            (name, round(x)): row.tolist()
            for name, x, row in zip(
                history.track, history.chainage_from, history.spans, strict=True
            )
        }
    tamped, untouched = [0, 1, 1], [0, 0, 0]
    assert spans["down"] == {
        (name, 200 * i): tamped if name == "down" and i < 3 else untouched
        for name in ("up", "down")
        for i in range(N)
    }
    assert [spans[None]["up", 200 * i] for i in range(N)] == [tamped] * 3 + [untouched] * 3


def test_the_worse_rail_of_a_line_is_that_of_the_whole_section(tmp_path):
    """Left is worse on the first 600 m, right behind: each section has the SD of its worse rail."""
    worse = np.where(X < 0.5 * LENGTH, 1.5, 1.0)
    runs = []
    for number, day in enumerate(DAYS[:2]):
        left = level(12) * (1.0 + 0.1 * number)
        rows = [
            f"{x:.3f},{1e3 * z * w:.5f},{1e3 * z * (2.5 - w):.5f}"
            for x, z, w in zip(X, left, worse, strict=True)
        ]
        text = "\n".join(["chainage_m,level_mm,right_mm", *rows])
        (tmp_path / f"two{number}.csv").write_text(text, encoding="utf-8")
        when = date(2024, 1, 1) + timedelta(days=day)
        runs.append({"file": f"two{number}.csv", "date": when.isoformat()})
    sds = {}
    for rails in ("worse", "mean"):
        record = {"second_level_column": "right_mm", "rails": rails}
        sds[rails] = build_line(study_of(tmp_path, runs=runs, record=record)).history.sd
    # The rails are 1.5 and 1.0 times one level: the worse has 1.5, their mean 1.25.
    middle = [0, 1, 4, 5]  # a step of the factor is near the others' ends
    np.testing.assert_allclose(sds["worse"][middle] / sds["mean"][middle], 1.2, rtol=0.02)
    np.testing.assert_allclose(sds["worse"][:, 1] / sds["worse"][:, 0], 1.1, rtol=0.02)
