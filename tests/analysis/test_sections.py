"""A line from a table of dated SDs to dates: recovered rates, limits, refusals, the command."""

import json
import re
from dataclasses import replace
from datetime import date

import numpy as np
import pytest
import toy
from typer.testing import CliRunner

from mcsettle.analysis.growth_courses import COARSE, FACTORS, between
from mcsettle.analysis.sections import line_hold_out, sections_report
from mcsettle.cli.app import app
from mcsettle.errors import InputError
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.storage.marks import mark_of
from mcsettle.study.build_line import build_line
from mcsettle.study.study import Study, load_study, resolved_toml

pytestmark = pytest.mark.usefixtures("fresh_cache")
DAYS, ERROR, N = np.array([0.0, 4.0, 8.0, 12.0]), 0.01, 24


def line_study(folder, csv: str, **line) -> Study:
    (folder / "sds.csv").write_text(csv, encoding="utf-8")
    table = {"sd_file": "sds.csv", "scenario": "v201", "sd_error_mm": ERROR, **line}
    study = toy.study(profile={"shortest_m": 3.0}, line=table)
    path = folder / "study.toml"
    path.write_text(resolved_toml(study), encoding="utf-8")
    return load_study(path)


def csv_of(sd_mm: np.ndarray) -> str:
    rows = ["chainage_from_m,chainage_to_m,date,sd_mm"]
    for section, row in enumerate(sd_mm):
        for day, sd in zip(DAYS, row, strict=True):
            when = date(2024, 1, 1 + int(day))
            rows.append(f"{200 * section},{200 * section + 200},{when},{sd:.5f}")
    return "\n".join(rows)


@pytest.fixture(scope="module")
def truth(fresh_cache):
    """SDs [S, D] mm of sections with factors of log-SD 0.4, by the toy's own Step B."""
    study = toy.study(profile={"shortest_m": 3.0})
    scene = study.scene("base", "v201")
    case = replace(build_case(scene, step_a([scene])), sd_limit=20e-3)
    engine = CycleJump(case)
    rng = np.random.default_rng(3)
    factors = np.exp(0.4 * rng.normal(size=N))
    start = scene.profiles.sample(range(500, 500 + N)) * 0.6
    sd = engine.run(start, DAYS, factors).history * 1e3
    return sd, factors, ERROR * rng.normal(size=sd.shape)


@pytest.fixture(scope="module")
def report(truth, tmp_path_factory):
    sd, _, noise = truth
    return sections_report(line_study(tmp_path_factory.mktemp("line"), csv_of(sd + noise)))


def test_factors_come_back_and_their_spread(report, truth):
    found = report.forecast.factors
    means = found.sections @ FACTORS
    assert np.corrcoef(means, np.log(truth[1]))[0, 1] > 0.6  # profiles are not known
    # Not below the truth of 0.4: what an unknown profile adds is taken for the section's factor.
    assert found.spread[0] > 0.25
    assert 0.4 < found.spread[2] < 1.2


def test_every_section_has_a_row_and_the_first_is_due_first(report):
    table = report.table
    assert sorted(table["chainage_from_m"]) == [200.0 * i for i in range(N)]
    assert table["priority"].tolist() == list(range(1, N + 1))
    due = [day for day in table["due_p50"] if day is not None]
    assert due == sorted(due)
    late = table["due_p95"].isna()
    assert not table.loc[~late, "due_p05"].isna().any()
    chances = table[["probability_1y", "probability_2y"]].to_numpy()
    assert np.all(np.diff(chances, axis=1) >= -1e-12)


def test_lengths_due_add_up(report):
    total = 0.2 * N
    assert report.due["due_km_p50"].sum() <= total * 1.2
    assert (report.due["due_km_p05"] <= report.due["due_km_p95"]).all()


def test_held_out_run_is_inside_the_bands(truth, tmp_path):
    sd, _, noise = truth
    _, held = line_hold_out(line_study(tmp_path, csv_of(sd + noise)))
    assert held.coverage > 0.7  # of 24; nominal 0.9, three standard errors 0.18
    assert held.mean_absolute_error()["forecast"] < 3.0 * ERROR * 1e-3


def test_a_section_beyond_its_limit_is_due_today(truth, tmp_path):
    sd = truth[0].copy()
    sd[5, -1] = 1.6
    table = sections_report(line_study(tmp_path, csv_of(sd))).table
    first = table.iloc[0]
    assert (first["chainage_from_m"], bool(first["beyond_limit"])) == (1000.0, True)
    assert first["due_p05"] == first["due_p95"] == date(2024, 1, 13)


def test_limits_and_exclusions_differ_along_the_line(truth, tmp_path):
    stretches = [
        {"chainage_from_m": 0.0, "chainage_to_m": 400.0, "sd_limit_mm": 0.3},
        {"chainage_from_m": 400.0, "chainage_to_m": 600.0, "exclude": "switch"},
    ]
    report = sections_report(line_study(tmp_path, csv_of(truth[0]), stretches=stretches))
    assert report.table["beyond_limit"].sum() == 2
    assert 400.0 not in report.table["chainage_from_m"].tolist()
    assert any("1 sections are left out" in remark for remark in report.line.remarks)


def test_a_tamping_is_detected_and_said(truth, tmp_path):
    sd = truth[0].copy()
    sd[:3, 0] = 1.4
    line = sections_report(line_study(tmp_path, csv_of(sd))).line
    assert (~np.isnan(line.history.tamped_on)).sum() == 3
    assert any("3 sections fell so far" in remark for remark in line.remarks)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("sd_mm", "sd"), "no column 'sd_mm'"),
        (("2024-01-01", "45292"), "45292"),
        ((",0.", ",x0."), "are no numbers"),
        (("0,200,", "300,200,"), "must lie beyond chainage_from_m"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused_in_words(truth, tmp_path, change, words):
    study = line_study(tmp_path, csv_of(truth[0]).replace(*change))
    with pytest.raises(InputError, match=words):
        sections_report(study)


def test_a_table_of_sds_is_read_as_the_record_says(tmp_path):
    """Semicolons, decimal commas and Windows-1252, as spreadsheets write them."""
    text = "chainage_from_m;chainage_to_m;date;sd_mm;Bemerkung\n"
    text += "".join(f"0;200;2024-0{month}-01;1,{month}5;Brücke\n" for month in (1, 2, 3))
    record = {"separator": "semicolon", "decimal": ","}
    study = line_study(tmp_path, text, record=record)
    (tmp_path / "sds.csv").write_bytes(text.encode("cp1252"))
    with pytest.raises(InputError, match=r"byte 0xfc.*encoding = \"cp1252\""):
        build_line(study)
    study = line_study(tmp_path, text, record=record | {"encoding": "cp1252"})
    (tmp_path / "sds.csv").write_bytes(text.encode("cp1252"))
    sd = build_line(study).history.sd
    np.testing.assert_allclose(sd, [[1.15e-3, 1.25e-3, 1.35e-3]])


def test_a_study_without_a_line_is_refused(tmp_path):
    with pytest.raises(InputError, match="takes \\[line\\]"):
        sections_report(toy.study())


def test_the_command_prints_writes_and_draws(truth, tmp_path):
    line_study(tmp_path, csv_of(truth[0] + truth[2]))
    study, table, picture = (tmp_path / name for name in ("study.toml", "s.csv", "s.png"))
    done = CliRunner().invoke(
        app, ["sections", str(study), "--table", str(table), "--picture", str(picture)]
    )
    assert done.exit_code == 0, done.stderr
    assert f"{N} sections, 4.8 km" in done.stdout
    assert max(len(line) for line in done.stdout.splitlines()) <= 100
    assert len(table.read_text(encoding="utf-8").splitlines()) == N + 1
    assert picture.read_bytes().startswith(b"\x89PNG")
    told = CliRunner().invoke(app, ["sections", str(study), "--json"])
    assert len(json.loads(told.stdout)["sections"]) == N


@pytest.mark.parametrize(("table", "picture"), [("s.xlsx", "s.svg"), ("s.parquet", "s.png")])
def test_only_files_of_the_same_study_are_replaced(truth, tmp_path, table, picture):
    line_study(tmp_path, csv_of(truth[0] + truth[2]))
    study, files = tmp_path / "study.toml", (tmp_path / table, tmp_path / picture)
    call = ["sections", str(study), "--table", str(files[0]), "--picture", str(files[1])]
    files[0].write_text("mine", encoding="utf-8")
    refused = CliRunner().invoke(app, call)
    assert refused.exit_code == 2
    assert "--force" in refused.stderr
    assert files[0].read_text(encoding="utf-8") == "mine"
    assert CliRunner().invoke(app, [*call, "--force"]).exit_code == 0
    assert {mark_of(path) for path in files} == {load_study(study).identity}
    assert CliRunner().invoke(app, call).exit_code == 0
    text = study.read_text(encoding="utf-8")
    study.write_text(re.sub(r"horizon_years = .*", "horizon_years = 7", text), encoding="utf-8")
    assert CliRunner().invoke(app, call).exit_code == 2


def test_a_table_without_a_place_for_a_mark_is_not_replaced(truth, tmp_path):
    line_study(tmp_path, csv_of(truth[0]))
    path = tmp_path / "s.csv"
    path.write_text("mine", encoding="utf-8")
    call = ["sections", str(tmp_path / "study.toml"), "--table", str(path)]
    assert CliRunner().invoke(app, call).exit_code == 2
    assert path.read_text(encoding="utf-8") == "mine"


def test_between_is_linear_and_keeps_what_is_never_reached():
    values = np.where(np.arange(len(COARSE)) < 3, np.inf, COARSE)
    found = between(values)
    finite = np.isfinite(found)
    np.testing.assert_allclose(found[finite], FACTORS[finite], atol=1e-12)
    assert np.all(np.isinf(found[COARSE[3] - 1e-9 > FACTORS]))
