"""Guards whose absence nothing else notices: each test fails without its one line."""

import hashlib
import json
import os
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
import toy
from toy import everything

from mcsettle.errors import InputError
from mcsettle.report.export import _cell
from mcsettle.report.figures.style import drawn, styled
from mcsettle.run import close, worker
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.step_b.stepwise import Stepwise
from mcsettle.storage import parquet
from mcsettle.storage.location import place
from mcsettle.storage.manifest import MANIFEST
from mcsettle.storage.provenance import read_provenance
from mcsettle.storage.shard_record import fault, read_record, record_name
from mcsettle.study.extent import extent_of
from mcsettle.study.read import parsed_toml
from mcsettle.study.study import load_study
from mcsettle.summary.results import study_of

pytestmark = pytest.mark.usefixtures("fresh_cache")


@pytest.fixture(scope="module")
def study():
    return toy.study(run={"realisations": 2})


def small(study, folder):
    """A run of two realisations in shards of four: the next one is begun by it."""
    return run_study(study, folder, RunOptions(shard_size=4)).folder


def test_rows_of_an_altered_shard_are_not_taken_over_by_a_larger_run(study, tmp_path):
    """A valid file of other numbers, which its record does not fit."""
    folder = small(study, tmp_path / "grown")
    path = next((folder / "realisations").iterdir())
    table = pq.read_table(path)
    place_of = table.schema.get_field_index("sd_initial_mm")
    wrong = table.set_column(place_of, table.schema.field(place_of), [np.full(len(table), 9.0)])
    path.write_bytes(parquet.encode(wrong))
    run_study(study, folder, RunOptions(realisations=4))
    whole = run_study(study, tmp_path / "whole", RunOptions(realisations=4, shard_size=4)).folder
    assert everything(folder) == everything(whole)


def test_a_record_of_another_run_is_none(study, tmp_path):
    folder = small(study, tmp_path / "out")
    at, name = place(folder), next((folder / "realisations").iterdir()).name
    provenance = read_provenance(at)
    assert read_record(at, name, provenance) is not None
    path = folder / record_name(name)
    data = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(data | {"provenance": "ef" * 32}), encoding="utf-8")
    assert read_record(at, name, provenance) is None


def test_a_shard_of_other_rows_than_its_record_says_is_damaged(study, tmp_path):
    """Its hash is right, and so is the number of rows that is asked for."""
    folder = small(study, tmp_path / "out")
    at, name = place(folder), next((folder / "realisations").iterdir()).name
    record = read_record(at, name, read_provenance(at))
    assert record is not None
    assert fault(at, name, record, 2) is None
    assert fault(at, name, replace(record, rows=4), 4) == f"realisations/{name} has 2 rows, not 4"


def test_gather_takes_the_manifest_away_before_it_changes_a_table(study, tmp_path, monkeypatch):
    """Where it is stopped half way the folder says so."""
    folder = small(study, tmp_path / "out")
    assert (folder / MANIFEST).exists()
    monkeypatch.setattr(close, "_write_effects", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        close.gather(folder)
    assert not (folder / MANIFEST).exists()
    monkeypatch.undo()
    assert close.gather(folder).finished


def test_a_study_of_a_terabyte_is_not_read(tmp_path):
    path = tmp_path / "study.toml"
    path.touch()
    os.truncate(path, 1 << 40)
    with pytest.raises(InputError, match=f"{1 << 40} bytes; a study has at most"):
        load_study(path)


def test_a_march_that_is_no_number_has_failed():
    case = toy.case(shortest=8.0, horizon=1.0)
    start = toy.profiles(range(2), shortest=8.0)
    start[1, 3] = np.nan
    outcome = Stepwise(case, "every_axle", "spectral").run(start, np.array([0.0]))
    assert outcome.failed.tolist() == [False, True]
    assert not outcome.reached[1]


def test_a_worker_of_another_folder_is_refused(study, tmp_path, monkeypatch):
    folder = small(study, tmp_path / "out")
    monkeypatch.setattr(worker, "_own_kernels", lambda: None)
    digest = read_provenance(folder).digest
    extent = extent_of(study_of(folder))
    right = worker.RunSpec(str(folder), digest, extent, None, None)
    worker._set_up(right)
    for other in (
        right._replace(provenance="ef" * 32),
        right._replace(extent=replace(extent, realisations=3)),
        right._replace(extent=replace(extent, n_sets=2)),
    ):
        with pytest.raises(InputError, match="is not the folder of this run"):
            worker._set_up(other)


def test_transfer_functions_under_another_name_are_refused(tmp_path):
    at = place(tmp_path)
    monitor = toy.transfer()
    from mcsettle.step_a.transfer_file import save

    save(monitor, tmp_path / "x.npz")
    at.write(f"{worker.STEP_A}/{'ef' * 32}.npz", (tmp_path / "x.npz").read_bytes())
    at.write(worker.INDEX, json.dumps({"base": {"A": ["ef" * 32]}}).encode())
    with pytest.raises(InputError, match="holds another file"):
        worker.read_step_a(at)


def test_a_table_of_very_many_keys_is_refused_by_their_number():
    text = "[table]\n" + "".join(f"k{i} = 1\n" for i in range(1001))
    with pytest.raises(InputError, match="a table has 1001 keys; at most 1000"):
        parsed_toml(text.encode(), "study.toml")


def test_a_workbook_has_no_control_characters():
    assert _cell("a\x07\nb") == "a\ufffd b"


def test_a_title_with_dollars_is_drawn_as_it_is():
    """It is no formula: one that is wrong would end the picture."""
    from matplotlib.figure import Figure

    @styled
    def picture() -> Figure:
        figure = Figure()
        figure.suptitle(r"$\frac{ $")
        return figure

    assert b"frac" in drawn(picture(), "svg", **{"svg.fonttype": "none"})


def test_a_written_file_is_what_it_was_when_the_system_says_so(tmp_path, monkeypatch):
    """Synchronised before it is moved, and its folder after."""
    place(tmp_path).write("x", b"before")  # its folders are there, and synchronised
    order = []
    for name in ("fsync", "replace"):
        kept = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *a, k=kept, n=name: (order.append(n), k(*a))[1])
    place(tmp_path).write("x", b"data")
    assert order == ["fsync", "replace", "fsync"]
    assert hashlib.sha256((tmp_path / "x").read_bytes()).hexdigest()[:4] == "3a6e"
