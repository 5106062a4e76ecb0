"""Most pairs of sections outlive the horizon: no view states a mean or a price of the rest."""

import csv
import json
import re
from pathlib import Path

import made_run
import numpy as np
import pytest
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.report.build import read_report
from mcsettle.report.render import html, markdown
from mcsettle.summary.results import read_results
from mcsettle.summary.summary import summary_rows

HORIZON = {"sd_limit_mm": 1.5, "horizon_years": 1.5}
BASE = np.where(np.arange(48) < 13, np.linspace(400.0, 540.0, 48), np.nan)
FASTER = np.where(np.arange(48) < 44, np.linspace(250.0, 540.0, 48), np.nan)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    made = made_run.study(limit=HORIZON)
    run = tmp_path_factory.mktemp("minority") / "run"
    return made_run.write(run, made, {"v201": BASE, "v225": FASTER})


@pytest.fixture(scope="module")
def forbidden(folder: Path) -> str:
    """Mean of the known pairs, as any view would round it."""
    effects = read_results(folder).effects
    known = effects["marginal_cost"].dropna().to_numpy()
    assert len(known) == 13
    shapes = [f"{np.mean(known):.{digits}f}" for digits in (2, 3, 4)]
    return "|".join(rf"(?<![\d.]){re.escape(shape)}(?!\d)" for shape in shapes)


def invoke(*arguments: object) -> str:
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert done.exit_code == 0, done.output
    return done.stdout


def test_summary_has_no_number_of_a_minority(folder: Path) -> None:
    rows = [r for r in summary_rows(read_results(folder)) if r.scenario == "v225"]
    for row in rows:
        if row.metric not in ("reduction_percent", "elasticity", "marginal_cost"):
            continue
        assert row.at(0.5).value is None
        assert row.at(0.5).n_censored == 35
        told = {s.statistic for s in (*row.statistics, *row.spread) if s.estimate.value is not None}
        assert not told & {"mean", "section_mean", "line_mean", "cost_at_mean_interval"}


@pytest.mark.parametrize("options", [(), ("--all",), ("--json",)])
def test_summarise(folder: Path, forbidden: str, options) -> None:
    text = invoke("summarise", folder, *options)
    assert not re.search(forbidden, text)
    if not options:
        assert "at most" in text
        assert "13 of 48 pairs of sections reach the limit" in text


def test_report_in_both_forms(folder: Path, forbidden: str) -> None:
    page = read_report(folder)
    shown = markdown(page) + re.sub(r"<[^>]*>", " ", html(page).split("<body>")[1])
    assert not re.search(forbidden, shown)
    assert "no price. Only 13 of 48 pairs of sections reach the limit within 1.5 years" in shown
    assert "is at most" in shown


def test_export_and_compare(folder: Path, forbidden: str, tmp_path: Path) -> None:
    invoke("export", folder, "--csv", tmp_path / "csv")
    with (tmp_path / "csv" / "summary.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["metric"] == "marginal_cost"]
    stated = {row["statistic"] for row in rows if row["value"]}
    assert not stated & {"quantile", "mean", "line_mean", "section_mean", "cost_at_mean_interval"}
    compared = invoke("compare", folder, folder, "--json")
    costs = [row for row in json.loads(compared)["rows"] if row["metric"] == "marginal_cost"]
    assert costs
    assert not re.search(forbidden, json.dumps(costs))
