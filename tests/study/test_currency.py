"""Prices in any currency: what a study takes, and that no view of a run in kronor speaks of pounds."""

import copy
import json
from pathlib import Path

import made_run
import numpy as np
import pandas as pd
import pytest
import toy
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.errors import InputError
from mcsettle.report.build import read_report
from mcsettle.report.export import write_csv
from mcsettle.report.material import read_material
from mcsettle.report.render import html, markdown
from mcsettle.study.study import Study
from mcsettle.study.written import study_data
from mcsettle.summary.results import read_results

SEK = {"effect": "speed", "baseline": "v201", "currency": "SEK", "tamping_cost_per_track_km": 60000}
PRESENT, FORMER = "tamping_cost_per_track_km", "tamping_cost_gbp_per_track_km"


def former(study: Study) -> dict:
    """The data of ``study`` with its cost under the key that named the currency."""
    data = copy.deepcopy(study_data(study))
    del data["economics"]["currency"]
    text = json.dumps(data).replace(PRESENT, FORMER)
    return json.loads(text)


def test_a_cost_is_read_whether_or_not_its_key_names_the_currency() -> None:
    plain = made_run.study(economics={**SEK})
    named = made_run.study(
        economics={"effect": "speed", "baseline": "v201", "tamping_cost_sek_per_track_km": 60000}
    )
    assert named.economics == plain.economics
    assert named.digest == plain.digest


def test_inputs_and_sources_follow_the_key_of_the_cost() -> None:
    study = toy.uncertain(toy.COST, toy.LOAD, correlations=[
        {"inputs": [toy.COST["input"], toy.LOAD["input"]], "rank": 0.2}
    ], sources={f"economics.{PRESENT}": "an offer"})  # fmt: skip
    old = Study.from_mapping(former(study))
    assert old == study
    assert old.digest == study.digest


@pytest.mark.parametrize(
    ("economics", "said"),
    [
        ({"currency": "GPB"}, "received 'GPB', which is no currency code of ISO 4217"),
        ({"currency": "EUR"}, "economics.tamping_cost_per_track_km: is missing"),
        ({"currency": "EUR", FORMER: 5000.0}, "is a cost in GBP beside currency = 'EUR'"),
        ({PRESENT: 1.0, FORMER: 5000.0}, f"is the same input as {PRESENT}: keep one"),
    ],
)
def test_currencies_that_do_not_agree_are_refused(economics, said) -> None:
    with pytest.raises(InputError, match="economics") as refused:
        made_run.study(economics={"effect": "speed", "baseline": "v201", **economics})
    assert said in str(refused.value)


def test_a_published_cost_is_in_the_currency_of_the_study() -> None:
    published = {"metric": "marginal_cost", "scenario": "v225", "value": 1.0, "source": "Table 1",
                 "unit": "GBP per km/h per 1000 train-km"}  # fmt: skip
    with pytest.raises(InputError, match=r"reference\[1\].unit: received 'GBP …'.* to SEK"):
        made_run.study(economics=SEK, reference=[published])


@pytest.fixture(scope="module")
def kronor(tmp_path_factory) -> Path:
    days = np.linspace(600.0, 800.0, 9)
    made = made_run.study(economics=SEK)
    folder = tmp_path_factory.mktemp("kronor") / "run"
    return made_run.write(folder, made, {"v201": days, "v225": days * np.linspace(0.8, 0.95, 9)})


def test_no_view_of_a_run_in_kronor_speaks_of_pounds(kronor: Path, tmp_path: Path) -> None:
    page = read_report(kronor)
    write_csv(read_material(kronor), tmp_path / "csv")
    views = {"html": html(page), "markdown": markdown(page)}
    for options in ((), ("--all",), ("--json",)):
        views[str(options)] = CliRunner().invoke(app, ["summarise", str(kronor), *options]).stdout
    views |= {p.name: p.read_text() for p in (tmp_path / "csv").glob("*.csv")}
    views["dictionary"] = (kronor / "data_dictionary.csv").read_text()
    for name, text in views.items():
        # Published costs of others stay in the currency of their source.
        own = text.split("Published marginal costs of track")[0]
        assert not any(word in own for word in ("GBP", "pence", "pounds", "£5", "£0")), name
    for name in ("html", "markdown", "()", "--all", "about.csv", "columns.csv", "dictionary"):
        key = next(k for k in views if name in k)
        assert "SEK" in views[key], name
    assert "Swedish kronor (SEK)" in views["html"]
    assert "SEK 60000 a track-km" in views["html"]


def test_arrays_and_columns_name_the_currency(kronor: Path) -> None:
    import pyarrow.parquet as pq

    pytest.importorskip("xarray")
    data = read_results(kronor).to_xarray()
    assert data["marginal_cost"].attrs["units"].startswith("SEK per km/h")
    shard = next((kronor / "effects").glob("*.parquet"))
    assert pq.read_schema(shard).field("marginal_cost").metadata[b"unit"].startswith(b"SEK")


def test_results_of_the_former_key_are_read(kronor: Path, monkeypatch) -> None:
    study = toy.uncertain(toy.COST)
    column = f"input_economics_{FORMER}"
    held = read_results(kronor).realisations.assign(**{column: 5600.0})
    monkeypatch.setattr("mcsettle.summary.results.study_of", lambda at: study)
    monkeypatch.setattr(
        "mcsettle.summary.results._table",
        lambda at, name: held if name == "realisations" else pd.DataFrame(),
    )
    assert f"input_economics_{PRESENT}" in read_results(kronor).realisations.columns
