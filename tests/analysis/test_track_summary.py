"""The report of a track, its pictures and tables, and the command that writes them."""

import csv
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy
from typer.testing import CliRunner

from mcsettle.analysis.table4 import DYNAMIC, OVERHEAD
from mcsettle.analysis.track_case import TrackCase, table4, track_cases
from mcsettle.analysis.track_summary import (
    describe,
    speed_warnings,
    track_summary,
)
from mcsettle.cli.app import app
from mcsettle.cli.track import table4_lines, track_lines
from mcsettle.report import track_pictures
from mcsettle.report.track_pictures import draw_track
from mcsettle.step_a import critical_speed
from mcsettle.study.study import Study, resolved_toml

pytestmark = pytest.mark.usefixtures("fresh_cache")


def published(metric: str, value: float) -> dict[str, Any]:
    return {"metric": metric, "scenario": "v225", "value": value, "unit": "%", "source": "Table 4"}


@pytest.fixture(scope="module")
def study() -> Study:
    """The toy study with Table 4 of the paper at 225 km/h."""
    reference = [
        published("quasi_static_stress_increase_percent", 5.8),
        published("dynamic_stress_increase_percent", 12.7),
    ]
    return toy.study(reference=reference)


@pytest.fixture(scope="module")
def case(study: Study, fresh_cache: Path) -> TrackCase:
    return track_cases(study)[0]


def test_rows_are_plain_numbers_with_units(case: TrackCase) -> None:
    rows = describe(case)
    assert all(isinstance(name, str) and isinstance(unit, str) for name, _, unit in rows)
    assert {type(value) for _, value, _ in rows} == {float, str}
    found = {name: (value, unit) for name, value, unit in rows}
    assert found["subgrade: height"] == ("unbounded", "")
    assert found["ballast: height"] == (0.3, "m")
    # √(G/ρ) of the lean clay: 70 MPa / 2(1 + 0.35) / 1900 kg/m³
    value, unit = found["subgrade: shear wave speed"]
    assert value == pytest.approx(3.6 * np.sqrt(70e6 / 2.7 / 1900.0))
    assert unit == "km/h"
    assert len([name for name in found if "rail deflection" in name]) == 2  # two speeds, once each
    assert track_summary(case.study) == rows


def test_trains_near_the_critical_speed_are_told(
    case: TrackCase, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert speed_warnings(case) == []
    fast = case.runs[1].service.speed
    monkeypatch.setattr(critical_speed, "critical_speed_of", lambda response: fast / 0.81)
    monkeypatch.setattr(critical_speed, "lowest_critical_speed", lambda response: 0.0)
    (remark,) = speed_warnings(case)
    assert "225 km/h: 81% of the critical speed of track and ground (278 km/h)" in remark


def test_table4_stands_beside_the_published_values(case: TrackCase) -> None:
    said = []
    table = table4(case, lambda *step: said.append(step))
    assert table == table4(case)
    assert said[-1] == ("Stress at the subgrade surface", 2, 2)
    fast = {row.definition: row for row in table if row.scenario == "v225"}
    assert (fast[OVERHEAD].published, fast[DYNAMIC].published) == (5.8, 12.7)
    assert fast[DYNAMIC].low < fast[DYNAMIC].percent < fast[DYNAMIC].high
    text = "\n".join(table4_lines(table))
    assert "225 km/h" in text
    assert f"{fast[DYNAMIC].percent:.2f} (" in text
    assert text.count("published") == 3
    assert list(table4_lines([])) == []


def test_table4_needs_a_second_speed_of_one_train(study: Study) -> None:
    data = tomllib.loads(resolved_toml(study))
    data["scenarios"] = data["scenarios"][:1]
    data["reference"], data["variants"] = [], data["variants"][:1]
    assert table4(track_cases(Study.from_mapping(data))[0]) == []


def test_lines_have_four_digits() -> None:
    lines = list(track_lines([("speed", 393.1973, "km/h"), ("height", "unbounded", "")]))
    assert lines == ["speed       393.2 km/h", "height  unbounded"]


def test_pictures_and_tables_are_written(
    case: TrackCase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That the same numbers give the same bytes, test_figures says picture by picture."""
    monkeypatch.setattr(track_pictures, "FREIGHT_CARS", 2)
    monkeypatch.setattr(
        track_pictures, "MODELS", {"passenger": (toy.PASSENGER, 1, 55.0, ("complete",))}
    )
    rows, table, said = describe(case), table4(case), []
    written = draw_track(case, rows, table, tmp_path, lambda *step: said.append(step))
    names = {path.name for path in written}
    kinds = {"receptance", "stress_depth", "stress_along", "table4", "vehicle_models",
             "freight_passage"}  # fmt: skip
    assert names == {f"{k}.{e}" for k in kinds for e in ("png", "svg")} | {
        "track.csv", "stress_depth.csv", "table4.csv"}  # fmt: skip
    assert all(path.stat().st_size > 100 for path in written)
    assert said[-1] == ("Pictures", 6, 6)
    with (tmp_path / "track.csv").open(encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == len(rows)
    with (tmp_path / "table4.csv").open(encoding="utf-8", newline="") as file:
        entries = list(csv.DictReader(file))
    assert [float(e["increase_percent"]) for e in entries] == [row.percent for row in table]
    assert {e["published_percent"] for e in entries} == {"", "5.8", "12.7"}


def test_track_command(toy_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []
    monkeypatch.setattr(
        track_pictures, "draw_track", lambda *a: drawn.append(a[3]) or [a[3] / "track.csv"]
    )
    out = tmp_path / "pictures"
    done = CliRunner().invoke(app, ["track", str(toy_path), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "rail deflection, quasi-static" in done.stdout
    assert "Wrote 1 files" in done.stderr
    assert drawn == [out]
    file = tmp_path / "file"
    file.write_text("x", encoding="utf-8")
    done = CliRunner().invoke(app, ["track", str(toy_path), "--out", str(file)])
    assert done.exit_code == 2
    assert "name a folder" in done.stderr
    assert done.stdout == ""
