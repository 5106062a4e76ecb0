"""Inputs of others: mutated studies, damaged folders, foreign caches. Refused in words, or right.

Every case runs under an alarm; a case that raises anything but ``InputError``, that
hangs, or that reads other numbers than were written, is a fault. The numbers of cases are those of the
fast suite and, ``slow``, of the whole campaign; seeds are fixed, so a case can be run again.
"""

import contextlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import traceback
import warnings
import zipfile
from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import toy
from alarm import in_time
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.errors import InputError, NumericalError
from mcsettle.run.close import gather
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.status import survey
from mcsettle.step_a import track_response
from mcsettle.step_a.beam import beam_response
from mcsettle.step_a.fem25d.cache import read_arrays, write_arrays
from mcsettle.step_a.transfer_file import load, save
from mcsettle.storage import npz, parquet, shard_record
from mcsettle.storage.files import cache_folder
from mcsettle.storage.manifest import MANIFEST
from mcsettle.storage.provenance import PROVENANCE
from mcsettle.study.study import Study, load_study, resolved_toml, study_from_text
from mcsettle.summary.results import read_results

ROOT = Path(__file__).resolve().parents[2]
STUDIES = sorted((ROOT / "studies").glob("*.toml"))
FAST, LONG = 60, 3000  # cases of one kind
KERNELS = str(cache_folder())  # compiled ones, before a test has a cache of its own


FAULTS = (Exception, pytest.fail.Exception)  # of a case: an alarm too


def in_words(error: InputError) -> None:
    assert 0 < len(str(error)) < 20_000


def refused_or_sound(text: bytes) -> Study | None:
    """A study is refused in words (None), or is one that can be written and read again as it is."""
    with in_time():
        try:
            study = study_from_text(text, "study.toml", ROOT / "studies")
        except InputError as error:
            in_words(error)
            return None
        again = study_from_text(resolved_toml(study).encode(), "again", ROOT / "studies")
        assert again.digest == study.digest
        return study


# --- studies --------------------------------------------------------------------------------------

TOKENS = (
    "nan", "inf", "-1", "0", "1e308", "1e-308", "9" * 400, "true", '""', "[]", "{}", "1979-05-27",
    '"70 MPa"', '"1e9 km/h"', "[[]]", "{ a = 1 }", '"../../x"', '"/etc/passwd"', '"http://x/y"', "'\\'",
    "0x1F", "1_000", "[1, 'a']", '"' + "x" * 3000 + '"', "\u0000", "-0.0", '"\\ud800"',
    "9223372036854775808",
)  # fmt: skip


def mutated(text: str, rng: random.Random) -> bytes:
    """A study file with one to four changes: values, lines, bytes."""
    for _ in range(rng.randrange(1, 5)):
        lines = text.split("\n")
        i = rng.randrange(len(lines))
        kind = rng.randrange(8)
        if kind < 3 and "=" in lines[i]:
            lines[i] = lines[i].split("=")[0] + "= " + rng.choice(TOKENS)
        elif kind == 3:
            del lines[i]
        elif kind == 4:
            lines.insert(rng.randrange(len(lines)), lines[i])
        elif kind == 5:
            lines[i] = re.sub(r"[0-9]+", lambda _: rng.choice(TOKENS), lines[i], count=1)
        elif kind == 6:
            lines[i] = lines[i][: rng.randrange(len(lines[i]) + 1)]
        else:
            at = rng.randrange(len(lines[i]) + 1)
            lines[i] = lines[i][:at] + chr(rng.randrange(1, 0x250)) + lines[i][at:]
        text = "\n".join(lines)
    data = bytearray(text.encode("utf-8", "surrogatepass"))
    if data and rng.random() < 0.1:
        data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


def fuzz_studies(cases: int, start: int) -> None:
    texts, accepted = [path.read_text(encoding="utf-8") for path in STUDIES], 0
    for case in range(start, start + cases):
        rng = random.Random(case)
        data = mutated(rng.choice(texts), rng)
        try:
            accepted += refused_or_sound(data) is not None
        except FAULTS as error:
            raise AssertionError(f"case {case}: {data!r}") from error
    assert 0.05 < accepted / cases < 0.95  # both ways are tried


def test_mutated_studies():
    fuzz_studies(2 * FAST, 0)


@pytest.mark.slow
def test_very_many_mutated_studies():
    fuzz_studies(2 * LONG, 1_000_000)


NUMBER = re.compile(r"(?<![\w.])-?[0-9]+(\.[0-9]+)?(?![\w.])")
FACTORS = (0.0, -1.0, 1e-300, 1e-6, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0, 1e3, 1e300)


def nudged(text: str, rng: random.Random) -> bytes:
    """A study file with one or two of its numbers multiplied: half of them still pass."""
    for _ in range(rng.choice((1, 1, 2))):
        number = rng.choice(list(NUMBER.finditer(text)))
        value = float(number.group()) * rng.choice(FACTORS)
        new = int(value) if value.is_integer() and abs(value) < 1e18 else value
        text = f"{text[: number.start()]}{new}{text[number.end() :]}"
    return text.encode()


def tiny_studies() -> list[str]:
    """Files of studies whose runs are a few waves of one car, the cheapest more often than the others."""
    plain = {"economics": None, "scenarios": [toy.scenario("v201", 201.0)]}
    load = {"uncertain": [toy.LOAD], "run": {"parameter_sets": 2}}
    ballast = {"variants": [{"name": "b"}, {"name": "f", "settlement_factor": 200.0}]}
    variants = [toy.tiny(**plain)] * 6 + [toy.tiny(), toy.tiny(**plain, **load)]
    return [resolved_toml(study) for study in [*variants, toy.tiny(**plain, **ballast)]]


def fuzz_runs(folder: Path, cases: int, start: int) -> Counter[str]:
    """Studies with a change, run where they are accepted; what became of them, by kind.

    Raises
    ------
    AssertionError
        Names every case that is neither refused in words nor run to an end.
    """
    texts, told, wrong = tiny_studies(), Counter[str](), list[str]()
    for case in range(start, start + cases):
        rng = random.Random(case)
        data = (nudged if rng.random() < 0.2 else mutated)(rng.choice(texts), rng)
        data = data.encode() if isinstance(data, str) else data
        told["cases"] += 1
        try:
            study = refused_or_sound(data)
            if study is not None:
                told["accepted"] += 1
                with in_time(60.0, 900.0):
                    told[run_to_an_end(study, folder / "out", rng.random() < 0.05)] += 1
        except FAULTS:
            wrong.append(f"case {case}: {traceback.format_exc()[-1500:]}")
        shutil.rmtree(folder / "out", ignore_errors=True)
    assert not wrong, "\n".join(wrong)
    assert told["accepted"] >= cases // 25
    return told


def run_to_an_end(study: Study, out: Path, twice: bool) -> str:
    """What became of a run, in a word; ``twice``: to the same bytes."""
    options = RunOptions(realisations=2, parameter_sets=2 if study.nested else None)
    try:
        finished = run_study(study, out, options)
    except InputError as error:
        in_words(error)
        return "refused"
    except NumericalError:
        return "beyond numbers"
    rows = toy.table(out, "realisations")
    keys = ["variant", "scenario", "parameter_set", "realisation"]
    sets = 2 if study.nested else 1
    assert len(rows) == 2 * sets * len(study.variant_names) * len(study.scenarios)
    assert not rows[keys].duplicated().any()
    failed = rows["status"] == "failed"
    assert failed.sum() == rows["failure"].notna().sum() == finished.n_failed
    days = rows["tamping_interval_days"].fillna(rows["censored_at_days"])[~failed]
    assert (np.isfinite(days) & (days > 0.0)).all()
    numbers = rows.loc[~failed, ["sd_initial_mm", "sd_final_mm", "passages"]]
    assert np.isfinite(numbers).all(axis=None)
    assert not (out / ".tmp").exists()
    if twice:
        before = toy.everything(out)
        shutil.rmtree(out)
        run_study(study, out, options)
        assert toy.everything(out) == before
    return "failed" if failed.any() else "ran"


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        (
            "height_m",
            5e299,
            r"layers\.sub_ballast\.height_m: received 5e\+299; it must be less than",
        ),
        ("strength_pa", 3.5e-295, "the inputs lead to numbers that cannot be computed"),
    ],
)
def test_numbers_far_from_any_track_are_told_in_words(fresh_cache, tmp_path, key, value, said):
    text = resolved_toml(toy.tiny()).partition("[track.layers.sub_ballast]")
    line = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", text[2], count=1)

    def run() -> None:
        study = study_from_text((text[0] + text[1] + line).encode(), "study.toml")
        run_study(study, tmp_path / "out", RunOptions(realisations=2))

    with few_waves(), pytest.raises((InputError, NumericalError), match=said):
        run()


@contextlib.contextmanager
def few_waves():
    """Step A of the closed-form track no finer than runs need that nobody looks at."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            track_response,
            "beam_response",
            lambda track, depth=5.5: beam_response(track, depth, period=100.0, cutoff=5.0),
        )
        yield


def test_what_is_accepted_runs(fresh_cache, tmp_path):
    with few_waves():
        fuzz_runs(tmp_path, 40, 0)


@pytest.mark.slow
def test_five_hundred_that_are_accepted_run(fresh_cache, tmp_path):
    with few_waves():
        fuzz_runs(tmp_path, 500, 1_000_000)


KEYS = st.sampled_from(
    [*Study.model_fields, "track", "trains", "file", "name", "x", "per_day", "kind"]
)
LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20) | st.dates()
TREES = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=6)
)


def made(data: dict) -> None:
    """Nested values as no TOML file has them are refused too."""
    with in_time(), contextlib.suppress(InputError):
        Study.from_mapping(data)


@seed(2026)
@settings(max_examples=FAST, deadline=None, database=None)
@given(st.dictionaries(KEYS, TREES, max_size=10))
def test_made_studies(data):
    made(data)


@pytest.mark.slow
@seed(2027)
@settings(max_examples=LONG, deadline=None, database=None,
          suppress_health_check=list(HealthCheck))  # fmt: skip
@given(st.dictionaries(KEYS, TREES, max_size=10))
def test_very_many_made_studies(data):
    made(data)


BOMBS = {
    "dotted": "a" + ".a" * 400_000 + " = 1",
    "dotted, in lines": ("a" + ".b" * 2400 + " = 1\n") * 100,
    "brackets": "a = " + "[" * 900_000,
    "tables": "".join(f"[t{i}]\n" for i in range(60_000)),
    "keys": "".join(f"k{i} = 1\n" for i in range(60_000)),
    "scenarios": "[[scenarios]]\n" * 60_000,
    "inline": "a = " + "{ a = " * 100_000,
    "headings": "[" + ".".join(["a"] * 2000) + "]\n",
    "trains": "".join(f'[trains.t{i}]\nvehicle = "x"\n' for i in range(20_000)),
    "number": "seed = " + "9" * 900_000,
    "days": "[run]\nhistory_days = [" + "1," * 400_000 + "]",
    "string": 'title = "' + "x" * 900_000 + '"',
    "quotes": "title = " + '"' * 900_000,
    "nul": "\0" * 1000,
    "large": "#" * 1_000_001,
}


# Each by its own guard: what comes later would refuse most of them too, after more work.
REFUSED = {
    "dotted": "more than 2500 dots",
    "brackets": "nested too deeply",
    "tables": "60000 keys; at most 1000",
    "keys": "60000 keys; at most 1000",
    "scenarios": "120003 faults",
    "inline": "nested too deeply",
    "headings": "more than 12 tables in one another",
    "trains": "20000 keys; at most 1000",
    "number": "integer string conversion",
    "large": "1000001 bytes; a study has at most 1000000",
}


@pytest.mark.parametrize("name", BOMBS)
def test_bombs_are_refused_in_time(name, tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(BOMBS[name], encoding="utf-8")
    with in_time(), pytest.raises(InputError, match=REFUSED.get(name, "study.toml")) as told:
        load_study(path)
    assert len(str(told.value)) < 20_000


@pytest.mark.parametrize(
    ("line", "key"),
    [("title = .*", "title"), ("seed = 1", "seed"), ('model = "beam"', "model"), ("sd_mm = .*", "file")],
)  # fmt: skip
def test_nothing_of_a_study_is_run(tmp_path, line, key):
    """Not even what looks like it: names, templates, paths are texts."""
    mark = tmp_path / "mark"
    evil = f"__import__('pathlib').Path({str(mark)!r}).touch()"
    text = (ROOT / "studies" / "toy.toml").read_text(encoding="utf-8")
    changed, n = re.subn(f"(?m)^{line}$", lambda _: f'{key} = "{evil}"', text, count=1)
    assert n == 1
    refused_or_sound(changed.encode())
    assert not mark.exists()


# --- results folders ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def results(fresh_cache, tmp_path_factory):
    study = toy.study(run={"realisations": 4})
    return run_study(
        study, tmp_path_factory.mktemp("hostile") / "out", RunOptions(shard_size=2)
    ).folder


def damaged(folder: Path, rng: random.Random) -> str:
    """Change one thing of a results folder; says what."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and ".locks" not in p.parts)
    path = rng.choice(files)
    data = bytearray(path.read_bytes() or b" ")  # it may have been emptied before
    kind = rng.choice(("bit", "bytes", "cut", "grow", "empty", "delete", "copy", "noise", "text"))
    if kind == "bit":
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    elif kind == "bytes":
        at = rng.randrange(len(data))
        data[at : at + rng.randrange(1, 64)] = rng.randbytes(rng.randrange(64))
    elif kind == "cut":
        del data[rng.randrange(len(data)) :]
    elif kind == "grow":
        data += rng.randbytes(rng.randrange(1, 100))
    elif kind == "empty":
        data.clear()
    elif kind == "noise":
        data = bytearray(rng.randbytes(len(data)))
    elif kind == "copy":
        data = bytearray(rng.choice(files).read_bytes())
    elif kind == "text" and path.suffix in (".json", ".toml"):
        text = data.decode("utf-8", "replace")  # it may have been damaged before
        spots = [m.span() for m in re.finditer(r"[0-9]+|\"[^\"]*\"", text)] or [(0, 0)]
        first, last = rng.choice(spots)
        text = text[:first] + rng.choice(TOKENS) + text[last:]
        data = bytearray(text.encode("utf-8", "replace"))
    if kind == "delete":
        path.unlink()
    else:
        path.write_bytes(bytes(data))
    return f"{kind} {path.relative_to(folder)}"


def fuzz_folders(results: Path, folder: Path, cases: int, start: int) -> None:
    """Damage a copy of a finished run; what is then read is refused or what was written."""
    whole = read_results(results)
    for case in range(start, start + cases):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(results, folder)
        rng = random.Random(case)
        done = [damaged(folder, rng) for _ in range(rng.choice((1, 1, 1, 2, 3)))]
        try:
            with in_time():
                compared(folder, whole, rng.random() < 0.3)
        except FAULTS as error:
            raise AssertionError(f"case {case}: {done}") from error


def compared(folder: Path, whole, close: bool) -> None:
    """Readers and ``survey``; with ``close`` the manifest is taken away and the run closed again."""
    if close:
        (folder / MANIFEST).unlink(missing_ok=True)
        with contextlib.suppress(InputError):
            gather(folder)
    with contextlib.suppress(InputError):
        survey(folder)
    with contextlib.suppress(InputError):
        found = read_results(folder)
        for name in ("realisations", "history", "effects"):
            assert getattr(found, name).equals(getattr(whole, name)), name
        assert found.study.digest == whole.study.digest


def test_damaged_folders(results, tmp_path):
    fuzz_folders(results, tmp_path / "copy", FAST, 0)


@pytest.mark.slow
def test_very_many_damaged_folders(results, tmp_path):
    fuzz_folders(results, tmp_path / "copy", LONG, 1_000_000)


def test_a_damaged_folder_shows_no_traceback(results, tmp_path):
    for case in range(6):
        folder = tmp_path / str(case)
        shutil.copytree(results, folder)
        damaged(folder, random.Random(case))
        for verb in ("status", "gather", "summarise"):
            done = CliRunner().invoke(app, [verb, str(folder)])
            assert done.exit_code in (0, 2), (case, verb, done.exception)
            assert done.exception is None or isinstance(done.exception, SystemExit)


def test_a_bomb_of_rows_is_refused():
    """A few bytes that would unpack to a billion rows."""
    kept = parquet.MOST_ROWS
    sink = pa.BufferOutputStream()
    column = pa.chunked_array([pa.nulls(kept // 100 + 1, pa.int8())] * 100)
    pq.write_table(pa.table({"x": column}), sink, row_group_size=kept + 200)
    data = sink.getvalue().to_pybytes()
    assert len(data) < 1_000_000
    with in_time(), pytest.raises(InputError, match="no table of a run is as large"):
        parquet.decode(data, "bomb.parquet")


@pytest.mark.parametrize(
    "text",
    ["[" * 100_000, '{"files": [' + "{}," * 10_000 + "{}]}", "9" * 100_000, '{"a": 1e999}', "null"],
)  # fmt: skip
def test_hostile_json(results, tmp_path, text):
    """Without the manifest or the provenance nothing is read; a shard's record condemns the shard."""
    folder = tmp_path / "copy"
    shutil.copytree(results, folder)
    for path in (folder / MANIFEST, folder / PROVENANCE):
        data = path.read_bytes()
        path.write_text(text, encoding="utf-8")
        for read in (survey, read_results):
            with in_time(), pytest.raises(InputError, match=f"{path.name}' is damaged"):
                read(folder)
        path.write_bytes(data)
    shard = next((folder / shard_record.RECORDS).iterdir())
    shard.write_text(text, encoding="utf-8")
    (folder / MANIFEST).unlink()  # as while a run goes on: the records alone say what is there
    with in_time():
        (fault,) = survey(folder).faults
        assert fault.shard.removesuffix(".parquet") == shard.stem


# --- caches ---------------------------------------------------------------------------------------


class Evil:
    """Unpickling it would write a file."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def test_a_cache_is_never_unpickled(tmp_path):
    mark = tmp_path / "mark"
    path = tmp_path / "section-1.npz"
    np.savez(
        path, checksum=np.array("x"), evil=np.array([Evil(mark)], dtype=object), allow_pickle=True
    )
    with pytest.warns(RuntimeWarning, match="damaged"):
        assert read_arrays(path, "thing", dict) is None
    with pytest.raises(InputError, match="damaged"):
        load(path)
    assert not mark.exists()


@pytest.mark.parametrize(("limit", "most"), [("LARGEST", 1_000), ("MOST_MEMBERS", 3)])
def test_a_cache_that_would_fill_the_memory_is_refused(tmp_path, monkeypatch, limit, most):
    """Whole files that could be read: only their size, or number of arrays, speaks against them."""
    one, two = tmp_path / "section-1.npz", tmp_path / "transfer.npz"
    write_arrays(one, {"x": np.zeros(1_000), "y": np.zeros(1), "z": np.zeros(1)})
    save(toy.transfer(), two)
    assert read_arrays(one, "thing", dict) is not None
    assert load(two).digest == toy.transfer().digest
    monkeypatch.setattr(npz, limit, most)
    with pytest.warns(RuntimeWarning, match="more than any of ours"):
        assert read_arrays(one, "thing", dict) is None
    with pytest.raises(InputError, match="more than any of ours"):
        load(two)


def test_an_array_that_says_it_is_larger_than_the_memory_is_refused(tmp_path):
    path = tmp_path / "section-1.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        header = "{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000000,), }"
        text = header.ljust(117).encode() + b"\n"
        archive.writestr("a.npy", b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text)
    with in_time():
        with pytest.warns(RuntimeWarning, match="damaged"):
            assert read_arrays(path, "thing", dict) is None
        with pytest.raises(InputError, match="damaged"):
            load(path)


def fuzz_caches(folder: Path, cases: int, start: int) -> None:
    """Damaged arrays: computed again, or what was written."""
    one, two = folder / "section-1.npz", folder / "transfer.npz"
    arrays = {"x": np.arange(200.0), "y": np.ones((3, 4), complex)}
    write_arrays(one, dict(arrays))
    save(toy.transfer(), two)
    kept = {path: path.read_bytes() for path in (one, two)}
    for case in range(start, start + cases):
        rng = random.Random(case)
        for path, data in kept.items():
            wrong = bytearray(data)
            for _ in range(rng.randrange(1, 4)):
                wrong[rng.randrange(len(wrong))] = rng.randrange(256)
            path.write_bytes(bytes(wrong[: rng.choice((len(wrong), rng.randrange(len(wrong))))]))
        with in_time(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = read_arrays(one, "thing", dict)
            assert found is None or all(np.array_equal(found[k], arrays[k]) for k in arrays), case
            with contextlib.suppress(InputError):
                again = load(two)
                assert np.array_equal(again.quasi_static, toy.transfer().quasi_static), case


def test_damaged_caches(tmp_path):
    fuzz_caches(tmp_path, FAST, 0)


@pytest.mark.slow
def test_very_many_damaged_caches(tmp_path):
    fuzz_caches(tmp_path, LONG // 3, 1_000_000)


# --- network --------------------------------------------------------------------------------------


NETWORK = 97  # exit code of a process that would have used it
ALONE = f"""
import json, os, sys

def forbid(event, arguments):
    if event.startswith(("socket.connect", "socket.bind", "socket.send", "socket.get", "urllib.")):
        if event != "socket.gethostname":
            os.write(2, event.encode())
            os._exit({NETWORK})  # nothing can take it for a fault of its own and go on

sys.addaudithook(forbid)
from mcsettle.storage import location
location.Bucket.__init__ = lambda *_: forbid("socket.connect", "by pyarrow")  # not seen by the hook
from mcsettle.cli.app import app
for words in json.loads(sys.argv[1]):
    app(words, standalone_mode=False)
"""


def alone(folder: Path, *commands: list[str]) -> subprocess.CompletedProcess[str]:
    """Commands in a process that may not look for another machine."""
    return subprocess.run(
        [sys.executable, "-c", ALONE, json.dumps(commands)],
        capture_output=True, text=True, check=False, cwd=folder,
        env=os.environ | {"MCSETTLE_CACHE": str(folder / "cache"), "MCSETTLE_KERNELS": KERNELS},
    )  # fmt: skip


def test_no_network_unless_a_url_was_given(tmp_path):
    """From study to report, Step A included, and every table: all on this machine."""
    (tmp_path / "study.toml").write_text(resolved_toml(toy.tiny()), encoding="utf-8")
    run = ["run", "study.toml", "--out", "out"]
    reading = [["status", "out"], ["summarise", "out"], ["compare", "out", "out"],
               ["report", "out"], ["export", "out", "--csv", "csv"]]  # fmt: skip
    done = alone(tmp_path, ["check", "study.toml"], run, *reading)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out.html").stat().st_size > 10_000
    assert list((tmp_path / "csv").glob("*.csv"))


def test_a_url_that_was_given_is_looked_for(tmp_path):
    """The same guard sees it."""
    done = alone(tmp_path, ["status", "s3://bucket/run"])
    assert (done.returncode, done.stderr) == (NETWORK, "socket.connect")
