"""Reading a measured record: units, separators, runs, and what is wrong with it."""

import bz2
import gzip
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcsettle.errors import InputError
from mcsettle.railway.read_record import RecordFormat, read_record
from mcsettle.railway.record import Run, chosen_run
from mcsettle.railway.record_findings import findings, repaired, spike_places

X = np.arange(0.0, 60.0, 0.25)
LEVEL = 2e-3 * np.sin(X / 2.0)


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def rows(x: np.ndarray, level: np.ndarray, head: str = "chainage_m,level_mm") -> str:
    between = ";" if ";" in head else ","
    lines = [f"{a!r}{between}{b!r}" for a, b in zip(x.tolist(), level.tolist(), strict=True)]
    return "\n".join([head, *lines]) + "\n"


def test_csv_and_parquet_are_read_alike(tmp_path: Path) -> None:
    csv = written(tmp_path / "a.csv", rows(X, LEVEL * 1e3))
    table = pa.table({"chainage_m": X, "level_mm": LEVEL * 1e3, "other": ["x"] * len(X)})
    pq.write_table(table, tmp_path / "a.bin")
    for path in (csv, tmp_path / "a.bin"):
        (run,) = read_record(path, RecordFormat())
        np.testing.assert_allclose(run.chainage, X, rtol=0, atol=1e-12)
        np.testing.assert_allclose(run.level, LEVEL, rtol=0, atol=1e-12)
        assert findings(run) == []


def test_feet_and_inches_are_read_when_told_and_refused_when_not(tmp_path: Path) -> None:
    path = written(tmp_path / "ft.csv", rows(X / 0.3048, -LEVEL / 0.0254, "loc,level"))
    layout = {"chainage_column": "loc", "level_column": "level"}
    (run,) = read_record(
        path, RecordFormat(**layout, chainage_unit="ft", level_unit="in", positive="up")
    )
    np.testing.assert_allclose(run.chainage, X, atol=1e-9)
    np.testing.assert_allclose(run.level, LEVEL, atol=1e-12)
    with pytest.raises(InputError, match=r"unit of the chainage is not told.*'loc'"):
        read_record(path, RecordFormat(**layout))
    with pytest.raises(InputError, match="unit of the level is not told"):
        read_record(path, RecordFormat(**layout, chainage_unit="ft"))
    named = written(tmp_path / "named.csv", rows(X / 0.3048, LEVEL / 0.0254, "loc_ft,level_in"))
    layout = {"chainage_column": "loc_ft", "level_column": "level_in"}
    (run,) = read_record(named, RecordFormat(**layout))
    np.testing.assert_allclose(run.level, LEVEL, atol=1e-12)
    with pytest.raises(
        InputError, match=r"level_unit is 'mm', but the column 'level_in' says 'in'"
    ):
        read_record(named, RecordFormat(**layout, level_unit="mm"))


def test_separators_decimal_signs_and_rows_before_the_heading(tmp_path: Path) -> None:
    text = rows(X, LEVEL * 1e3, "chainage_m;level_mm").replace(".", ",")
    path = written(tmp_path / "a.csv", "made by a car\nin May\n" + text)
    (run,) = read_record(path, RecordFormat(separator="semicolon", decimal=",", skip_rows=2))
    np.testing.assert_allclose(run.level, LEVEL, atol=1e-12)
    with pytest.raises(InputError) as caught:  # every fault at once
        read_record(path, RecordFormat())
    for said in ("4 faults", 'separator = "semicolon"', "skip_rows = 2", 'decimal = ","'):
        assert said in str(caught.value)


def test_several_runs(tmp_path: Path) -> None:
    lines = [f"{x},{1000 * z},2014-11-10" for x, z in zip(X, LEVEL, strict=True)]
    lines += [f"{x},{2000 * z},2015-03-23" for x, z in zip(X, LEVEL, strict=True)]
    path = written(tmp_path / "runs.csv", "\n".join(["chainage_m,level_mm,date", *lines]))
    runs = read_record(path, RecordFormat(run_column="date"))
    assert [run.name for run in runs] == ["2014-11-10", "2015-03-23"]
    later = chosen_run(runs, "2015-03-23")
    np.testing.assert_allclose(later.level, 2.0 * LEVEL, atol=1e-12)
    assert chosen_run(runs, None) is runs[0]
    with pytest.raises(InputError, match="no run '2016'; its runs: 2014-11-10, 2015-03-23"):
        chosen_run(runs, "2016")
    # Without the column both runs are one, and the same track comes again.
    (both,) = read_record(path, RecordFormat())
    (finding,) = findings(both)
    assert (finding.kind, finding.count) == ("restarts", 1)
    assert "run_column" in finding.text


def test_each_finding_is_named_and_nothing_is_mended_in_silence() -> None:
    x, level = np.delete(X, [100, 101, 102]), np.delete(LEVEL, [100, 101, 102])
    level[50] += 0.02
    x, level = np.insert(x, 10, x[10]), np.insert(level, 10, level[10] + 2e-4)
    order = np.arange(len(x))
    order[[200, 201]] = order[[201, 200]]
    run = Run("up line", x[order], level[order], missing=3)
    kinds = ("missing", "unordered", "repeated", "gaps", "spikes")
    found = {f.kind: f for f in findings(run)}
    assert set(found) == set(kinds)
    assert found["gaps"].first == pytest.approx(x[100])
    assert found["spikes"].first == pytest.approx(12.5)
    with pytest.raises(InputError, match=r"'up line'.*missing: 3 rows.*unordered.*repeated.*gaps"):
        repaired(run, (), 5.0)
    with pytest.raises(InputError, match="has gaps: 1 gaps"):
        repaired(run, ("missing", "unordered", "repeated"), 5.0)
    with pytest.raises(InputError, match=r"a gap of 1 m; gaps of up to 0.9 m are bridged"):
        repaired(run, kinds, 0.9)
    kept = repaired(run, kinds[:-1], 5.0)  # spikes are reported, and stay
    assert np.max(np.abs(kept.level)) > 0.015
    sound = repaired(run, kinds, 5.0)
    assert np.all(np.diff(sound.chainage) > 0.0)
    np.testing.assert_allclose(sound.level, 2e-3 * np.sin(sound.chainage / 2.0), atol=1.2e-4)


def test_a_smooth_record_has_no_spikes() -> None:
    rng = np.random.default_rng(1)
    walk = np.cumsum(rng.normal(size=5000)) * 1e-4
    assert len(spike_places(walk)) == 0
    walk[700] += 0.01
    assert spike_places(walk).tolist() == [700]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty; a record has a heading"),
        ("chainage_m,level_mm\n", "0 points; a run needs at least ten"),
        (
            "chainage_m,level_mm\n1,x\n",
            "column 'level_mm': one cell is no finite number, .*line 2: 'x'",
        ),
        ("chainage_m,level_mm\n1,2\n3\n", r"1 line has another number of cells .*line 3 \(1\)"),
        ("chainage_m,chainage_m,level_mm\n1,1,2\n", "more than once"),
        ("a,b\n1,2\n", r"its columns: 'a' \(1\), 'b' \(2\)"),
        ("chainage_m,level_mm\n" + "1,inf\n" * 12, "12 cells are no finite number"),
        ("PAR1 not really", "no sound Parquet file"),
    ],
)
def test_what_is_no_record_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = written(tmp_path / "bad.csv", text)
    with pytest.raises(InputError, match=said):
        read_record(path, RecordFormat())


def test_missing_files_folders_and_large_files_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in (tmp_path / "none.csv", tmp_path):
        with pytest.raises(InputError, match="is no file"):
            read_record(path, RecordFormat())
    path = written(tmp_path / "a.csv", rows(X, LEVEL))
    monkeypatch.setattr("mcsettle.railway.read_record.LARGEST_FILE", 100)
    with pytest.raises(InputError, match="at most 100"):
        read_record(path, RecordFormat())
    monkeypatch.undo()
    monkeypatch.setattr("mcsettle.railway.read_record.MOST_ROWS", 100)
    with pytest.raises(InputError, match="240 rows; at most 100"):
        read_record(path, RecordFormat())


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_end_in_a_record_or_a_refusal(tmp_path_factory, content: bytes) -> None:
    path = tmp_path_factory.mktemp("bytes") / "a.csv"
    path.write_bytes(b"chainage_m,level_mm\n" + content)
    try:
        runs = read_record(path, RecordFormat())
    except InputError:
        return
    assert all(np.all(np.isfinite(run.level)) for run in runs)


# --- limits ---------------------------------------------------------------------------------------


def test_a_record_that_would_fill_the_memory_is_refused(tmp_path: Path) -> None:
    """By what it takes when it is read, not by what it takes on disk."""
    rows = 200_000
    text = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, np.int32)), ["a" * 10_000])
    x = np.arange(rows, dtype=float)
    path = tmp_path / "record.parquet"
    pq.write_table(pa.table({"run": text, "chainage_m": x, "level_mm": np.zeros(rows)}), path)
    layout = RecordFormat(run_column="run")
    with pytest.raises(InputError, match=r"asks for 2004\d* bytes of text in 200000 rows"):
        read_record(path, layout)


@pytest.mark.parametrize(("ending", "pack"), [("gz", gzip.compress), ("bz2", bz2.compress)])
def test_a_packed_record_is_not_unpacked(tmp_path: Path, ending: str, pack) -> None:
    path = tmp_path / f"record.csv.{ending}"
    path.write_bytes(pack(b"chainage_m,level_mm\n" + b"1,1\n" * 1_000_000))
    with pytest.raises(InputError, match=r"is packed \(.*unpack it, and name the file"):
        read_record(path, RecordFormat())


def test_lines_are_counted_before_they_are_read(tmp_path: Path, monkeypatch) -> None:
    from mcsettle.railway import read_record as reading
    from mcsettle.railway import record_table

    monkeypatch.setattr(reading, "MOST_ROWS", 10)
    monkeypatch.setattr(record_table, "_table", None)
    path = tmp_path / "record.csv"
    path.write_bytes(b"chainage_m,level_mm\n" + b",\n" * 2000)
    with pytest.raises(InputError, match="has 2001 lines; at most 10 rows are read"):
        read_record(path, RecordFormat())
