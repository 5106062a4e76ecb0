"""``[[effects]]``: what may be compared, what it is of, and that [economics] is short for it."""

import copy
import tomllib
from pathlib import Path

import made_run
import numpy as np
import pytest
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.economics import elasticity
from mcsettle.errors import InputError
from mcsettle.report.build import read_report
from mcsettle.report.charge_sheet import line_mean, pair_columns
from mcsettle.report.charging import price_units
from mcsettle.report.material import read_material
from mcsettle.report.render import html
from mcsettle.storage import store
from mcsettle.study.study import Study
from mcsettle.summary.compare import compare
from mcsettle.summary.results import read_results

STUDIES = Path(__file__).resolve().parents[2] / "studies"
MIXED = tomllib.loads((STUDIES / "mixed_line.toml").read_text(encoding="utf-8"))
NAMES = ["faster", "freight", "both against faster", "both against freight"]
BASE = np.linspace(500.0, 900.0, 24)
SHORTER = {"today": 1.0, "faster": 0.96, "freight": 0.9, "both": 0.85}


def mixed(**changes) -> Study:
    return Study.from_mapping(copy.deepcopy(MIXED) | changes)


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    spread = 1.0 + 0.02 * np.sin(np.arange(24))
    days = {name: BASE * share * spread**i for i, (name, share) in enumerate(SHORTER.items())}
    return made_run.write(tmp_path_factory.mktemp("mixed") / "run", mixed(), days)


def test_an_effect_is_of_its_own_train_and_against_its_own_baseline() -> None:
    study = mixed()
    assert list(study.effects) == NAMES
    speed = study.change("faster")
    assert speed is not None
    assert (speed.base, speed.changed) == (180.0, 200.0)
    assert speed.divisor == pytest.approx(200.0 * 72 * 365 / 1e3)  # passenger trains alone
    freight = study.change("freight")
    later = study.change("both against faster")
    assert freight is not None
    assert later is not None
    assert freight == later  # the same tonnage on both baselines
    assert study.change("both") is None


def test_economics_is_short_for_effects() -> None:
    short = made_run.tonnage_study()
    entry = {"scenario": "C", "baseline": "A", "effect": "tonnage", "train": "freight"}
    data = tomllib.loads(made_run.TOY.read_text(encoding="utf-8"))
    own = {
        "trains": {
            name: {"vehicle": name, "cars": n} for name, n in (("passenger", 11), ("freight", 40))
        },
        "scenarios": [s.model_dump(exclude_none=True) for s in short.scenarios],
        "economics": {},
        "effects": [entry],
    }
    del data["calibration"]
    long = Study.from_mapping(data | own)
    assert long.effects["C"].change == short.effects["C"].change
    assert long.reference_scenario == short.reference_scenario == "A"


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ([{"scenario": "faster", "baseline": "today", "effect": "speed"}],
         "needs the train that becomes faster"),
        ([{"scenario": "freight", "baseline": "today", "effect": "speed", "train": "passenger"}],
         "the same speed"),
        ([{"scenario": "both", "baseline": "today", "effect": "speed", "train": "passenger"}],
         "in more than the speed of 'passenger'"),
        ([{"scenario": "both", "baseline": "today", "effect": "tonnage", "train": "freight"}],
         "'freight' is not the train that is added: 'passenger' run otherwise"),
        ([{"scenario": "faster", "baseline": "today", "effect": "tonnage"}], "the same tonnage"),
        ([{"scenario": "faster", "baseline": "faster", "effect": "speed"}], "is the scenario itself"),
        ([{"scenario": "fast", "baseline": "today", "effect": "speed"}], "did you mean 'faster'?"),
        ([{"scenario": "faster", "baseline": "today", "effect": "speed", "train": "bus"}],
         "effects[1].train"),
        (MIXED["effects"] + MIXED["effects"][:1], "a second time"),
    ],
)  # fmt: skip
def test_what_cannot_be_compared_is_refused(entries, said) -> None:
    with pytest.raises(InputError) as refused:
        mixed(effects=entries)
    assert said in str(refused.value)


def test_what_is_compared_is_said_once() -> None:
    with pytest.raises(InputError, match=r"economics\.baseline: stands in each of the"):
        mixed(economics={"effect": "tonnage", "baseline": "today"})
    with pytest.raises(InputError, match=r"economics\.effect: is missing and has no default but"):
        mixed(effects=[])
    data = {k: v for k, v in MIXED.items() if k != "economics"}
    with pytest.raises(InputError, match=r"effects: has no meaning without \[economics\]"):
        Study.from_mapping(data)


def test_a_published_effect_names_its_baseline_where_there_are_several() -> None:
    row = {"metric": "elasticity", "scenario": "both", "value": -1.0, "unit": "1", "source": "x"}
    with pytest.raises(InputError, match=r"reference\[1\]\.baseline: is missing"):
        mixed(reference=[row])
    assert mixed(reference=[{**row, "baseline": "faster"}]).reference[0].baseline == "faster"


def test_every_effect_is_in_every_view(run: Path, tmp_path: Path) -> None:
    table = store.read(run, "effects").to_pandas()
    of_both = table[table["scenario"] == "both"]
    assert set(of_both["baseline"]) == {"faster", "freight"}
    base, other = (store.read(run, "realisations").to_pandas().query(f"scenario == '{name}'")
                   ["tamping_interval_days"].to_numpy() for name in ("freight", "both"))  # fmt: skip
    own = of_both[of_both["baseline"] == "freight"]["elasticity"].to_numpy()
    np.testing.assert_allclose(own, elasticity(base, other, 180.0, 200.0), rtol=1e-12)

    page, screen = html(read_report(run)), said(run)
    everything = said(run, "--all")
    for name in NAMES:
        assert name in everything
        assert name in page
    # Prices of trains and of tonnes on one axis: per train-km, the small ones with their digits.
    assert "per train-km" in screen
    assert "What do a faster passenger train and one more freight train cost in tamping?" in page
    assert "(beside passenger trains at 200 km/h)" in page
    material = read_material(run)
    sheet = {n: line_mean(p, 6500.0, 0.03) for (_, n), p in pair_columns(material).items()}
    assert set(sheet) == set(NAMES)
    for name, price in sheet.items():
        effect = material.answers.effect(name)
        assert effect is not None
        assert price == pytest.approx(effect.price.value, rel=1e-12)
        assert {u.label for u in price_units(material.study, name)} >= {"train-km", "vehicle-km"}
    again = compare(read_results(run), read_results(run))
    priced = {row.scenario for row in again.rows if row.metric == "marginal_cost"}
    assert priced == set(NAMES)


def said(folder: Path, *options: str) -> str:
    return CliRunner().invoke(app, ["summarise", str(folder), *options]).stdout
