"""Exports as workbooks read them, and every table of a run as other tools read its bare folder."""

import datetime
import re
from pathlib import Path

import duckdb
import made_run
import numpy as np
import openpyxl
import pandas as pd
import polars as pl
import pytest
import toy

from mcsettle.economics import marginal_cost
from mcsettle.errors import InputError
from mcsettle.report.charge_sheet import CHARGES, FIRST_ROW, PAIRS
from mcsettle.report.export import sheets, write_csv, write_xlsx
from mcsettle.report.material import Material, read_material
from mcsettle.run.pipeline import run_study
from mcsettle.storage.tables import TABLES

DAYS = np.linspace(500.0, 900.0, 11)
FORMULA = '=HYPERLINK("x","y")'


@pytest.fixture(scope="module")
def material(tmp_path_factory) -> Material:
    given = [s.model_dump(exclude_none=True) for s in made_run.study().scenarios]
    given[1]["title"] = FORMULA
    days = {"v201": DAYS, "v225": np.where(DAYS > 880.0, np.nan, 0.8 * DAYS)}
    made = made_run.study(scenarios=given, title="@title")
    return read_material(made_run.write(tmp_path_factory.mktemp("run") / "run", made, days))


def test_workbook_keeps_types_and_runs_no_formula(material: Material, tmp_path: Path) -> None:
    path = tmp_path / "book.xlsx"
    assert write_xlsx(material, path) == []
    book = openpyxl.load_workbook(path)
    assert [n for n in book.sheetnames if n not in (CHARGES, PAIRS)] == [
        s.name for s in sheets(material)
    ]
    for sheet in sheets(material):
        page = book[sheet.name]
        assert tuple(c.value for c in page[1]) == sheet.columns
        assert page.max_row == len(sheet.rows) + 1
        kinds = {cell.data_type for row in page.iter_rows() for cell in row}
        assert kinds <= {"s", "n", "b"}, sheet.name  # no formula, no error; empty cells are "n"
    summary = pd.read_excel(path, sheet_name="summary")
    ours = pd.DataFrame(list(sheets(material)[1].rows), columns=list(summary.columns))
    assert summary["value"].dtype == float
    # A workbook holds 16 digits.
    np.testing.assert_allclose(summary["value"], ours["value"].astype(float), rtol=1e-14)
    assert summary["n"].dtype == int
    effects = pd.read_excel(path, sheet_name="effects")
    assert effects["elasticity"].isna().sum() == 1  # the censored pair is an empty cell
    cells = [c.value for row in book["scenarios"].iter_rows() for c in row]
    assert FORMULA in cells
    assert book.properties.created == datetime.datetime(2000, 1, 1)


def evaluated(book: openpyxl.Workbook, formula: str) -> float:
    """What a workbook would make of a formula of ``charges``, from the cells it names."""

    def cells(match: re.Match[str]) -> str:
        sheet, area = match["sheet"] or CHARGES, match["area"].replace("$", "")
        found = book[sheet][area]
        if ":" not in area:
            return repr(float(found.value))
        return f"array({[float(row[0].value) for row in found]!r})"

    text = re.sub(
        r"(?:(?P<sheet>[a-z]+)!)?(?P<area>\$[A-Z]+\$\d+(:\$[A-Z]+\$\d+)?)", cells, formula[1:]
    )
    names = {
        "array": np.array, "EXP": np.exp, "COUNT": len, "IF": lambda c, a, b: a() if c else b(),
        "SUMPRODUCT": lambda *parts: float(np.sum(np.prod(np.broadcast_arrays(*parts), axis=0))),
    }  # fmt: skip
    text = re.sub(r"IF\(([^=,]*)=0,", r"IF(\1==0,", text)
    parts = re.fullmatch(r"(.*IF\([^,]*,)(SUMPRODUCT\(.*?\)),(SUMPRODUCT\(.*\))\)(/COUNT.*)", text)
    assert parts is not None, formula
    text = f"{parts[1]}lambda: {parts[2]},lambda: {parts[3]}){parts[4]}"
    return float(eval(text, names))


@pytest.mark.parametrize(
    ("cost", "rate", "level", "exchange"),
    [(5625.0, 0.035, 1.0, 1.0), (9000.0, 0.06, 1.2, 12.0), (5625.0, 0.0, 1.0, 1.0)],
)
def test_formulas_answer_what_ifs(
    material: Material, tmp_path: Path, cost: float, rate: float, level: float, exchange: float
) -> None:
    """Recalculated with other cells they give what the study with those values gives."""
    path = tmp_path / "book.xlsx"
    write_xlsx(material, path)
    book, stored = openpyxl.load_workbook(path), openpyxl.load_workbook(path, data_only=True)
    page = book[CHARGES]
    for cell, value in (("B3", cost), ("B4", rate), ("B5", level), ("B7", exchange)):
        page[cell].value = value
    effects = material.results.effects
    gamma = effects["elasticity"].dropna().to_numpy()
    years = DAYS[: len(gamma)] / 365.0
    divisor = material.study.change("v225").divisor
    own = float(np.mean(marginal_cost(gamma, years, cost, rate, divisor))) * level * exchange
    labels = {"km/h per 1000 train-km": 1.0, "1000 gross tonne-km": 24.0 / 748.0,
              "1000 gross tonne-mile": 24.0 / 748.0 * 1.609344, "train-km": 0.024,
              "vehicle-km": 0.024 / 11.0}  # fmt: skip
    rows = [row for row in page.iter_rows(min_row=FIRST_ROW + 1) if row[0].value]
    assert [row[2].value for row in rows] == list(labels)
    for row, factor in zip(rows, labels.values(), strict=True):
        assert evaluated(book, row[3].value) == pytest.approx(own * factor, rel=1e-9)
        if (cost, rate) == (5625.0, 0.035):
            assert stored[CHARGES].cell(row[3].row, 4).value == pytest.approx(
                own * factor, rel=1e-12
            )
            assert row[4].value == pytest.approx(own * factor, rel=1e-12)


def test_inputs_are_typed_and_tables_have_filters(material: Material, tmp_path: Path) -> None:
    path = tmp_path / "book.xlsx"
    write_xlsx(material, path)
    book = openpyxl.load_workbook(path)
    values = {row[0].value: row[1].value for row in book["inputs"].iter_rows(min_row=2)}
    assert values["economics.discount_rate"] == 0.035
    assert values["track.allow_supercritical"] is False
    assert all(page.auto_filter.ref for page in book if page.title != PAIRS)
    formats = {cell.value: book["realisations"].column_dimensions[cell.column_letter].number_format
               for cell in book["realisations"][1]}  # fmt: skip
    assert formats["tamping_interval_days"] == "0.0"


def test_same_run_same_workbook(material: Material, tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_xlsx(material, tmp_path / f"{name}.xlsx")
    assert (tmp_path / "a.xlsx").read_bytes() == (tmp_path / "b.xlsx").read_bytes()


def test_csv_is_read_back(material: Material, tmp_path: Path) -> None:
    written = write_csv(material, tmp_path / "csv")
    assert {p.stem for p in written} == {s.name for s in sheets(material)}
    rows = pd.read_csv(tmp_path / "csv" / "realisations.csv")
    held = material.results.realisations
    np.testing.assert_array_equal(
        rows["tamping_interval_days"], held["tamping_interval_days"].to_numpy(float)
    )
    assert pl.read_csv(tmp_path / "csv" / "effects.csv").height == len(material.results.effects)
    titles = pd.read_csv(tmp_path / "csv" / "scenarios.csv")["title"]
    assert titles[1] == f"'{FORMULA}"  # a spreadsheet shows it, and does not run it
    about = pd.read_csv(tmp_path / "csv" / "about.csv", index_col=0)["value"]
    assert about["title"] == "'@title"
    assert about["study digest"] == material.study.digest
    inputs = pd.read_csv(tmp_path / "csv" / "inputs.csv", index_col=0)
    assert inputs.loc["limit.sd_limit_mm", "value"] == "1.5"


def test_a_table_too_long_for_a_sheet_is_cut_and_said(
    material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mcsettle.report import export

    monkeypatch.setattr(export, "MOST_ROWS", 5)
    remarks = write_xlsx(material, tmp_path / "book.xlsx")
    assert any("'effects' holds the first 5 of 11 rows" in r for r in remarks)
    assert openpyxl.load_workbook(tmp_path / "book.xlsx")["effects"].max_row == 6


def test_every_table_of_a_run_is_read_as_a_bare_folder(fresh_cache, tmp_path: Path) -> None:
    uncertain = [{"input": "economics.discount_rate", "distribution": "uniform", "low": 0.03,
                  "high": 0.04}]  # fmt: skip
    run_study(
        toy.study(uncertain=uncertain, run={"parameter_sets": 2, "realisations": 3}), tmp_path
    )
    tables = [name for name in TABLES if (tmp_path / name).is_dir()]
    assert {"realisations", "history", "effects", "parameters", "summary"} <= set(tables)
    for name in tables:
        folder = tmp_path / name
        frames = [
            pd.read_parquet(folder),
            pl.read_parquet(f"{folder}/*.parquet").to_pandas(),
            duckdb.sql(f"select * from read_parquet('{folder}/*.parquet')").df(),
        ]
        keys = TABLES[name].keys
        first = frames[0].sort_values(keys, ignore_index=True)
        for other in frames[1:]:
            ordered = other.sort_values(keys, ignore_index=True)
            assert list(ordered.columns) == list(first.columns)
            for column in first.columns:
                one, two = (f[column].astype(object).where(f[column].notna(), None) for f in
                            (first, ordered))  # fmt: skip
                assert one.tolist() == two.tolist(), f"{name}.{column}"


def test_an_export_replaces_what_is_of_its_study_and_nothing_else(tmp_path: Path) -> None:
    """Whatever the tracks; others' files stay as they are."""

    def material_of(study, name: str) -> Material:
        days = {"v201": [400.0, 500.0, 600.0], "v225": [300.0, 400.0, 500.0]}
        return read_material(made_run.write(tmp_path / name, study, days))

    one = material_of(made_run.study(), "one")
    other_tracks = material_of(made_run.study(seed=9007199254740993), "two")
    other_study = material_of(made_run.study(limit={"sd_limit_mm": 2.0}), "three")
    path, folder = tmp_path / "out.xlsx", tmp_path / "csv"
    for write in (
        lambda material, **force: write_xlsx(material, path, **force),
        lambda material, **force: write_csv(material, folder, **force),
    ):
        write(one)
        write(other_tracks)
        with pytest.raises(InputError, match="is there already and is of another study"):
            write(other_study)
        write(other_study, force=True)
        with pytest.raises(InputError, match="is of another study"):
            write(one)
    path.write_bytes(b"precious")
    (folder / "about.csv").write_bytes(b"precious")
    with pytest.raises(InputError, match="is not written by mcsettle"):
        write_xlsx(other_study, path)
    with pytest.raises(InputError, match="is not written by mcsettle"):
        write_csv(other_study, folder)
    assert path.read_bytes() == (folder / "about.csv").read_bytes() == b"precious"


def test_a_large_seed_is_the_same_in_every_sheet(tmp_path: Path) -> None:
    seed = 2**53 + 1  # which no double holds
    days = {"v201": [400.0, 500.0, 600.0], "v225": [300.0, 400.0, 500.0]}
    folder = made_run.write(tmp_path / "run", made_run.study(seed=seed), days)
    write_xlsx(read_material(folder), tmp_path / "out.xlsx")
    about = openpyxl.load_workbook(tmp_path / "out.xlsx")["about"]
    assert {row[0].value: row[1].value for row in about.rows}["seed"] == str(seed)
