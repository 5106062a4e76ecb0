"""The table of what added services roughen and harden, as a run writes it."""

import json

import numpy as np
import pytest
import toy
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.run import sign_split
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.summary.results import read_results
from mcsettle.summary.sign_split import SHORTENS, SIGNS, sign_rows

pytestmark = pytest.mark.usefixtures("fresh_cache")
BASE = {"train": "passenger", "speed_kmh": 201.0, "per_day": 72}
SCENARIOS = [
    {"name": "A", "timetable": [BASE]},
    {"name": "B", "timetable": [BASE | {"per_day": 73}]},
    {"name": "fewer", "timetable": [BASE | {"per_day": 70}]},
]


def tonnage(**changes):
    economics = {"effect": "tonnage", "baseline": "A"}
    return toy.study(**({"scenarios": SCENARIOS, "economics": economics} | changes))


@pytest.fixture(scope="module")
def folder(fresh_cache, tmp_path_factory):
    return run_study(tonnage(), tmp_path_factory.mktemp("signs") / "out").folder


def test_rows_of_every_scenario_that_adds_services(folder):
    """B adds a train; what only removes trains adds nothing."""
    table = read_results(folder).sign_split
    assert set(table["scenario"]) == {"B"}
    assert list(table["realisation"]) == [0, 1, 2, 3]
    assert set(table["status"]) == {"paired"}
    np.testing.assert_allclose(table["reduction_percent"], 100.0 / 73.0, rtol=1e-4)
    assert (table["reduction_by_roughening_percent"] > table["reduction_percent"]).all()
    assert (table["reduction_by_hardening_percent"] < 0.0).all()
    np.testing.assert_allclose(table["roughening_ratio"], 1.0, atol=2e-3)


def test_bytes_do_not_depend_on_batches_or_on_being_written_again(folder, tmp_path):
    again = run_study(tonnage(), tmp_path / "out", RunOptions(batch=3)).folder
    assert toy.everything(again) == toy.everything(folder)
    run_study(tonnage(), again)
    assert toy.everything(again) == toy.everything(folder)
    (again / "sign_split" / sign_split.NAME).write_bytes(b"damaged")
    run_study(tonnage(), again)
    assert toy.everything(again) == toy.everything(folder)


def test_a_larger_run_splits_more_tracks_up_to_a_number(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(sign_split, "PAIRS", 6)
    for n in (4, 5, 8):
        run_study(tonnage(run={"realisations": n}), tmp_path / "out")
        assert len(read_results(tmp_path / "out").sign_split) == min(n, 6)


def test_no_table_without_added_services(tmp_path):
    fewer = tonnage(scenarios=[SCENARIOS[0], SCENARIOS[2]])
    done = run_study(fewer, tmp_path / "out").folder
    assert not (done / "sign_split").exists()
    assert sign_rows(read_results(done)) == []


def test_parameter_sets_are_split_at_the_studys_own_values(folder, tmp_path):
    nested = tonnage(run={"realisations": 4, "parameter_sets": 2}, uncertain=[toy.COST, toy.N0])
    done = read_results(run_study(nested, tmp_path / "out").folder)
    columns = [column for _, column, _ in SIGNS]
    np.testing.assert_array_equal(
        done.sign_split[columns], read_results(folder).sign_split[columns]
    )
    share = sign_rows(done)[-1].statistics[0].estimate
    assert (share.value, share.n) == (1.0, 8)


def test_summary_tables_and_json_have_the_split(folder):
    runner = CliRunner()
    printed = runner.invoke(app, ["summarise", str(folder), "--all"])
    assert printed.exit_code == 0
    assert "Why the effect has its sign" in printed.output
    data = json.loads(runner.invoke(app, ["summarise", str(folder), "--json"]).stdout)
    metrics = [row["metric"] for row in data["sign_split"]]
    assert metrics == [metric for metric, _, _ in SIGNS] + [SHORTENS]
    assert data["sign_split"][-1]["statistics"][0]["value"] == 1.0
    summary = toy.store.read(folder, "summary").to_pandas()
    assert set(metrics) <= set(summary["metric"])


def test_the_report_says_it_in_a_table(folder):
    from mcsettle.report.build import read_report
    from mcsettle.report.render import markdown

    assert "Why an effect has its sign" in markdown(read_report(folder))
