"""``summarise``: the answer on one screen, in thirty lines of eighty columns, digits whole."""

import re
from pathlib import Path

import made_run
import numpy as np
import pytest
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.cli.one_screen import COLUMNS, LINES, Size, _columns

DAYS = np.linspace(500.0, 900.0, 41)


def said(folder: Path, *options: str) -> str:
    done = CliRunner().invoke(app, ["summarise", str(folder), *options])
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.fixture(scope="module")
def freight(tmp_path_factory) -> Path:
    variants = [{"name": "soft"}, {"name": "stiff", "stress": "total"}]
    made = made_run.tonnage_study(variants=variants, economics={"effect": "tonnage",
                                  "baseline": "A", "price_base_year": 2021})  # fmt: skip
    folder = tmp_path_factory.mktemp("freight") / "run"
    return made_run.write(folder, made, {"A": DAYS, "C": 0.95 * DAYS})


def test_one_screen_has_the_answer(freight: Path) -> None:
    text = said(freight)
    lines = text.rstrip("\n").split("\n")
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= COLUMNS
    assert "What does one more freight train a day cost in tamping?" in text
    for part in ("GBP of 2021", "pence per 1000 gross tonne-km", "line mean (95 %)", "2 model forms",
                 "freight, 4000 t, 97 km/h", "half of the sections", "−5.0 %"):  # fmt: skip
        assert part in text
    assert re.search(r"C .* yes$", text, re.MULTILINE)


def test_where_room_is_short_the_range_over_forms_stays() -> None:
    rows = [("", "", "line mean (95 %)", "over forms", "supported"),
            ("heavier", "heavy, 880 t, 200 km/h", "0.1969 (0.1892 to 0.2050)", "0.1969 to 1.7012",
             "only as a range")]  # fmt: skip
    lines = list(_columns(rows, Size(COLUMNS, 1, folded=False), 1))
    assert "0.1969 to 1.7012" in lines[1]
    assert "heavy, 880" not in lines[1]
    assert max(map(len, lines)) <= COLUMNS
    assert "heavy, 880 t, 200 km/h" in list(_columns(rows, Size(100, 1, folded=False), 1))[1]


def test_a_saving_has_its_sign_and_one_form_is_no_yes(tmp_path: Path) -> None:
    made = made_run.tonnage_study()
    text = said(made_run.write(tmp_path / "run", made, {"A": DAYS, "C": 1.05 * DAYS}))
    assert re.search(r"C .* −\d.* as a range$", text, re.MULTILINE)
    assert "+5.0 %" in text
    assert "Run the set of forms" in text


def test_labels_that_have_no_room_stand_above_their_numbers(tmp_path: Path) -> None:
    """No number is cut in two, and the range over the forms is not dropped for a label."""
    names = ["A", "a_very_long_name_of_a_scenario", "B"]
    base = [{"train": "passenger", "speed_kmh": 200.0, "per_day": 72}]
    more = [*base, {"train": "freight", "speed_kmh": 97.0, "per_day": 2}]
    scenarios = [{"name": n, "timetable": base if n == "A" else more} for n in names]
    variants = [{"name": "soft"}, {"name": "stiff", "stress": "total"}]
    made = made_run.tonnage_study(scenarios=scenarios, variants=variants)
    days = {"A": DAYS, names[1]: 0.95 * DAYS, "B": 1.01 * DAYS}
    text = said(made_run.write(tmp_path / "run", made, days))
    assert "over forms" in text
    assert re.search(r"a_very_long_name_of_ …  2 × freight, 4000 t, 97 km/h\n +\d+\.\d", text)
    assert max(map(len, text.rstrip("\n").split("\n"))) <= COLUMNS


def test_many_scenarios_and_long_titles_stay_on_the_screen(tmp_path: Path) -> None:
    base = [{"train": "passenger", "speed_kmh": 200.0, "per_day": 72}]
    more = [{"train": "freight", "speed_kmh": 97.0, "per_day": 1}]
    names = ["A", *(f"scenario_{i}" for i in range(12))]
    scenarios = [
        {"name": n, "title": f"a title that is far too long for one line {n} " * 3,
         "timetable": base if n == "A" else [*base, {**more[0], "speed_kmh": 80.0 + i}]}
        for i, n in enumerate(names)
    ]  # fmt: skip
    made = made_run.tonnage_study(scenarios=scenarios, title="A study of many words " * 10)
    days = {n: DAYS * (1.0 - 0.01 * i) for i, n in enumerate(names)}
    lines = said(made_run.write(tmp_path / "run", made, days)).rstrip("\n").split("\n")
    assert len(lines) <= LINES
    # The folder's own path may be longer than a line; nothing else is.
    assert all(len(line) <= COLUMNS for line in lines)
    assert any("more scenarios: --all" in line for line in lines)


def test_every_number_at_eighty_columns_keeps_its_digits(
    freight: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mcsettle.cli.tables.WIDTH", COLUMNS)
    text = said(freight, "--all")
    assert "…" not in text
    assert max(map(len, text.split("\n"))) <= COLUMNS
    assert "marginal_cost" in text


@pytest.mark.parametrize("days", [[697.0], [np.nan] * 5], ids=["one", "never"])
def test_few_and_censored_sections(tmp_path: Path, days) -> None:
    folder = made_run.write(tmp_path / "run", made_run.study(), {"v201": days, "v225": days})
    text = said(folder)
    assert "1 sections" not in text
    assert not re.search(r"\b(nan|inf|None)\b|e−", text)
    if len(days) > 1:
        assert "0 of 5 pairs of sections reach the limit in 50 years" in text
        assert re.search(r"v201 .* > 18250 +> 18250$", text, re.MULTILINE)


def test_without_prices_there_are_intervals(tmp_path: Path) -> None:
    scenarios = [s.model_dump(exclude_none=True) for s in made_run.study().scenarios[:1]]
    made = made_run.study(economics=None, scenarios=scenarios)
    text = said(made_run.write(tmp_path / "run", made, {"v201": DAYS}))
    assert "How long until the track must be tamped?" in text
    assert "600 to 800" in text
    assert "supported" not in text
