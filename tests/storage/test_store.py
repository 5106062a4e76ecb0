"""Results survive the disk: same rows, same bytes, readable by others, faults named."""

import csv
import json
import os

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow.parquet as pq
import pytest

from mcsettle.errors import InputError
from mcsettle.storage import manifest, store
from mcsettle.storage.files import write_file
from mcsettle.storage.provenance import UNSAID, Provenance
from mcsettle.storage.shard_name import shard_name, slug
from mcsettle.storage.tables import TABLES

PROVENANCE = Provenance(
    package_version="1.0.0",
    study_digest="ab" * 32,
    transfer_digest="cd" * 32,
    seed=7,
    taichi_version="1.7.4",
    precision="f64",
    lanes=8,
)


def realisations(first, last, scenario="A"):
    """Rows of one shard; every third realisation is censored, every fifth failed."""
    index = np.arange(first, last + 1)
    days = np.where(index % 3 == 0, np.nan, 600.0 + index)
    failed = index % 5 == 4
    return {
        "variant": ["base"] * len(index),
        "scenario": [scenario] * len(index),
        "parameter_set": np.zeros(len(index), dtype=int),
        "realisation": index,
        "status": np.where(np.isnan(days), "censored", "reached"),
        "tamping_interval_days": days,
        "censored_at_days": np.where(np.isnan(days), 18_250.0, np.nan),
        "passages": index * 3168,
        "tonnage_mgt": index * 0.054,
        "sd_initial_mm": np.full(len(index), 1.03),
        "sd_final_mm": np.full(len(index), 1.5),
        "mean_settlement_mm": index / 7.0,
        "sd_growth_1y_mm": np.where(failed, np.nan, 0.24),
        "failure": ["step too small" if f else None for f in failed],
    }


def write_shard(folder, first, last, scenario="A"):
    name = shard_name("base", scenario, first, last)
    rows = realisations(first, last, scenario)
    return store.write(folder, "realisations", name, rows, PROVENANCE, first, last)


@pytest.fixture
def folder(tmp_path):
    """A finished results folder with two shards of each of two scenarios."""
    results = tmp_path / "results"
    store.prepare(results, PROVENANCE)
    for scenario in "AB":
        write_shard(results, 0, 9, scenario)
        write_shard(results, 10, 14, scenario)
    store.finish(results)
    return results


def test_round_trip(folder):
    table = store.read(folder, "realisations")
    assert table.num_rows == 30
    expected = realisations(0, 14)
    for name, values in expected.items():
        column = table.column(name).to_pylist()[:15]
        wanted = [None if v is None or v != v else v for v in values]
        assert column == wanted, name


def test_units_and_meanings_are_in_every_field(folder):
    path = next((folder / "realisations").iterdir())
    schema = pq.read_schema(path)
    assert schema.field("tamping_interval_days").metadata[b"unit"] == b"d"
    assert schema.field("sd_final_mm").metadata[b"unit"] == b"mm"
    assert all(field.metadata[b"description"] for field in schema)
    stored = pq.read_metadata(path).metadata
    assert stored[b"study_digest"] == b"ab" * 32
    assert stored[b"index_range"] in (b"0-9", b"10-14")
    assert {k.decode() for k in stored} >= set(PROVENANCE.__dataclass_fields__)


def test_compression_and_encoding(folder):
    path = folder / "realisations" / shard_name("base", "A", 0, 9)
    group = pq.read_metadata(path).row_group(0)
    for i in range(group.num_columns):
        column = group.column(i)
        assert column.compression == "ZSTD"
        if column.physical_type == "DOUBLE":
            assert "BYTE_STREAM_SPLIT" in column.encodings


def test_same_data_same_bytes(folder, tmp_path):
    again = tmp_path / "elsewhere"
    store.prepare(again, PROVENANCE)
    for scenario in "BA":  # in another order
        write_shard(again, 10, 14, scenario)
        write_shard(again, 0, 9, scenario)
    store.finish(again)
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        assert (again / path.relative_to(folder)).read_bytes() == path.read_bytes(), path.name


def test_bare_folder_is_read_by_pandas_polars_and_duckdb(folder):
    bare = folder / "realisations"
    frames = [
        pd.read_parquet(bare),
        pl.read_parquet(bare).to_pandas(),
        duckdb.sql(f"select * from read_parquet('{bare}/*.parquet')").df(),
    ]
    for frame in frames:
        assert len(frame) == 30
        assert frame["tamping_interval_days"].isna().sum() == 10
        assert frame["failure"].notna().sum() == 6
        assert frame["passages"].dtype == np.int64
    count = duckdb.sql(f"select count(failure) from read_parquet('{bare}/*.parquet')").fetchall()
    assert count == [(6,)]  # null, not an empty string


def test_only_parquet_in_table_folders_and_nothing_left_aside(folder):
    assert {p.suffix for p in (folder / "realisations").iterdir()} == {".parquet"}
    assert sorted(p.name for p in folder.iterdir()) == [
        "data_dictionary.csv",
        "manifest.json",
        "provenance.json",
        "realisations",
    ]


def test_data_dictionary_holds_every_column(folder):
    with (folder / "data_dictionary.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(r["table"], r["column"]) for r in rows] == [
        (name, column.name) for name, shape in TABLES.items() for column in shape.columns
    ]
    for row in rows:  # a column whose name ends in a unit has that unit
        for ending, unit in (("_mm", "mm"), ("_days", "d"), ("_mgt", "MGT"), ("_percent", "%")):
            assert not row["column"].endswith(ending) or row["unit"] == unit


def test_manifest_counts_rows_and_verifies(folder):
    listed = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    assert sum(f.get("rows", 0) for f in listed["files"]) == 30
    assert listed["provenance"]["seed"] == 7
    assert manifest.verify(folder) == 6


def test_damaged_file_is_named(folder):
    path = folder / "realisations" / shard_name("base", "B", 10, 14)
    path.write_bytes(path.read_bytes()[:-20])
    for check in (manifest.verify, lambda f: store.read(f, "realisations"), store.finish):
        with pytest.raises(InputError, match=r"base--B--00000010-00000014.*damaged"):
            check(folder)


def test_missing_and_stray_files_are_named(folder):
    path = folder / "realisations" / shard_name("base", "A", 0, 9)
    stray = folder / "realisations" / "notes.txt"
    stray.write_text("hello", encoding="utf-8")
    with pytest.raises(InputError, match=r"notes\.txt"):
        store.read(folder, "realisations")
    with pytest.raises(InputError, match=r"notes\.txt' is not in the manifest"):
        manifest.verify(folder)
    stray.unlink()
    path.unlink()
    with pytest.raises(InputError, match=r"00000000-00000009.*missing"):
        manifest.verify(folder)


def test_overlapping_shards_are_refused(folder):
    store.prepare(folder, PROVENANCE)
    write_shard(folder, 5, 9)
    with pytest.raises(InputError, match="its shards overlap"):
        store.read(folder, "realisations")


def test_another_study_is_refused_with_the_difference(folder):
    other = Provenance(**{**vars(PROVENANCE), "study_digest": "ef", "seed": 8})
    with pytest.raises(InputError, match=f"study digest {'ab' * 32} where this run has ef; seed 7"):
        store.prepare(folder, other)
    assert manifest.verify(folder) == 6  # refused before anything was touched


def test_results_of_another_runtime_are_refused(folder):
    other = Provenance(**{**vars(PROVENANCE), "runtime": "quadrants"})
    with pytest.raises(InputError, match="runtime taichi where this run has quadrants"):
        store.prepare(folder, other)


def test_shard_of_another_study_is_refused(folder):
    other = Provenance(**{**vars(PROVENANCE), "transfer_digest": "ef"})
    name = shard_name("base", "C", 0, 4)
    store.prepare(folder, PROVENANCE)
    store.write(folder, "realisations", name, realisations(0, 4, "C"), other, 0, 4)
    with pytest.raises(InputError, match=r"base--C.*transfer digest ef"):
        store.read(folder, "realisations")


def test_resuming_takes_the_manifest_away(folder):
    store.prepare(folder, PROVENANCE)
    with pytest.raises(InputError, match="not complete"):
        manifest.verify(folder)
    store.finish(folder)
    assert manifest.verify(folder) == 6


def test_failed_write_leaves_the_old_file(folder, monkeypatch):
    path = folder / "realisations" / shard_name("base", "A", 0, 9)
    before = path.read_bytes()

    def full(*_args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match="cannot be written: No space left"):
        write_shard(folder, 0, 9)
    assert path.read_bytes() == before
    assert list((folder / ".tmp").iterdir()) == []


def test_unwritable_folder_is_an_input_error(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be written"):
        store.prepare(blocked / "results", PROVENANCE)


def test_text_is_saved_as_given(tmp_path):
    path = write_file(tmp_path / "study.toml", "title = 'déjà vu'\n".encode())
    assert path.read_bytes() == "title = 'déjà vu'\n".encode()


@pytest.mark.parametrize("name", ["A", "201_km.h", "base-2"])
def test_safe_names_stay(name):
    assert slug(name) == name


def test_unsafe_names_stay_apart():
    names = ["a/b", "a b", "a--b", "../a", "é", "-", "x" * 100, "x" * 101, ".a", "a"]
    slugs = [slug(name) for name in names]
    assert len(set(slugs)) == len(names)
    for text in slugs:
        assert set(text).isdisjoint("/ é")
        assert "--" not in text
        assert not text.startswith((".", "-"))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"passages": None}, "differing: .*passages"),
        ({"colour": [1] * 5}, "differing: .*colour"),
        ({"sd_final_mm": [1.0, np.nan, 1.0, 1.0, 1.0]}, "sd_final_mm' has 1 empty"),
        ({"passages": ["many"] * 5}, "realisations.passages"),
        ({"passages": [1, 2]}, "different lengths"),
    ],
)
def test_wrong_columns_are_refused_by_name(tmp_path, change, words):
    rows = {**realisations(0, 4), **change}
    rows = {name: values for name, values in rows.items() if values is not None}
    with pytest.raises(InputError, match=words):
        store.write(tmp_path, "realisations", "x.parquet", rows, PROVENANCE)


def test_reading_what_is_not_there(folder, tmp_path):
    with pytest.raises(InputError, match="not a results folder"):
        store.read(tmp_path, "realisations")
    with pytest.raises(InputError, match="no table 'effects'"):
        store.read(folder, "effects")
    (folder / "provenance.json").write_text("{", encoding="utf-8")
    with pytest.raises(InputError, match=r"provenance\.json' is damaged"):
        store.read(folder, "realisations")


def test_results_of_changed_code_of_the_same_version_are_noticed(folder):
    changed = Provenance(**{**vars(PROVENANCE), "code_digest": "ef"})
    with pytest.raises(InputError, match="code digest  where this run has ef"):
        store.prepare(folder, changed)
    assert manifest.verify(folder) == 6


def without(folder, keys):
    """As it was written before provenance said ``keys``."""
    path = folder / "provenance.json"
    data = json.loads(path.read_text(encoding="utf-8"))
    data = {key: value for key, value in data.items() if key not in keys}
    path.write_text(json.dumps(data), encoding="utf-8")
    for shard in (folder / "realisations").iterdir():
        table = pq.read_table(shard)
        stored = {k: v for k, v in table.schema.metadata.items() if k.decode() not in keys}
        pq.write_table(table.replace_schema_metadata(stored), shard)


@pytest.mark.parametrize("keys", [("runtime",), ("runtime", "surrogate"), tuple(UNSAID)])
def test_a_folder_of_before_is_read(folder, keys):
    before = store.read(folder, "realisations")
    without(folder, keys)
    (folder / "manifest.json").unlink()
    assert store.read(folder, "realisations").equals(before)
    store.finish(folder)
    data = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    for key in keys:
        del data["provenance"][key]
    (folder / "manifest.json").write_text(json.dumps(data), encoding="utf-8")
    assert manifest.verify(folder) > 0


def test_a_shard_of_no_realisations_is_damage(folder):
    path = folder / "provenance.json"
    text = path.read_text(encoding="utf-8").replace(
        '"shard_realisations": 2048', '"shard_realisations": 0'
    )
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="shard_realisations is '0'"):
        store.read(folder, "realisations")


def test_a_shard_of_other_columns_is_refused(folder):
    path = next((folder / "realisations").iterdir())
    table = pq.read_table(path)
    (folder / "manifest.json").unlink()
    for other in (table.drop_columns(["failure"]), table.cast(table.schema.remove_metadata())):
        pq.write_table(other.replace_schema_metadata(table.schema.metadata), path)
        if other.schema.names == table.schema.names and other.schema.equals(table.schema):
            continue
        with pytest.raises(InputError, match="has other columns than table 'realisations'"):
            store.read(folder, "realisations")
