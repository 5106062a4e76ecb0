"""A run writes into a folder of its own, removes what runs wrote, and follows no link."""

import os
from pathlib import Path

import pytest

from mcsettle.errors import InputError
from mcsettle.storage import files, lock
from mcsettle.storage.foreign import is_ours, refuse_others_files, refuse_others_folder
from mcsettle.storage.location import Place, place
from mcsettle.storage.manifest import visible
from mcsettle.storage.provenance import PROVENANCE
from mcsettle.storage.shard_name import ShardName, shard_name, slug
from mcsettle.storage.shard_record import remove_shard

PRECIOUS = (
    ".tmp/draft.doc",
    "history/2023.csv",
    "effects/fx.wav",
    "realisations/notes.txt",
    "weights/weights.parquet",
    ".locks/db.json",
    "summary/summary.parquet",
    "data_dictionary.csv",
    "manifest.json",
    "study.toml",
    ".hidden",
)


def put(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("precious", encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", PRECIOUS)
def test_a_folder_of_somebody_is_refused(tmp_path, name):
    with pytest.raises(InputError, match="is not empty and holds no results"):
        refuse_others_folder(place(put(tmp_path, name)))
    assert (tmp_path / name).read_text(encoding="utf-8") == "precious"


def test_new_and_empty_folders_and_those_of_runs_are_not_refused(tmp_path):
    refuse_others_folder(place(tmp_path / "new"))
    refuse_others_folder(place(tmp_path))
    with lock.held(place(tmp_path), "run"):  # what a run leaves that was killed before its results
        files.write_bytes(tmp_path, ".log/x.jsonl", b"")
        put(tmp_path, f".tmp/{files.unfinished('provenance.json')}")
        refuse_others_folder(place(tmp_path))
    refuse_others_folder(place(put(tmp_path, PROVENANCE, "anything")))


def test_files_of_somebody_among_results_are_named(tmp_path):
    name = f"history/{shard_name('base', 'A', 0, 7)}"
    put(tmp_path, PROVENANCE, name, "weights/weights.parquet", "notes/history.txt")
    refuse_others_files(place(tmp_path))
    put(tmp_path, "history/2023.csv")
    with pytest.raises(InputError, match=r"history/2023\.csv' is of no run"):
        refuse_others_files(place(tmp_path))


@pytest.mark.parametrize("name", [n for n in PRECIOUS if "/" in n and "parquet" not in n])
def test_names_of_others_are_not_ours(name):
    assert not is_ours(name)


def test_unfinished_files_of_ours_are_swept_and_others_stay(tmp_path):
    put(tmp_path, ".tmp/draft.doc", f".tmp/{files.unfinished('x')}", f".tmp/{'y' * 9}.part")
    place(tmp_path).sweep()
    assert place(tmp_path).unfinished() == ["draft.doc"]


def test_the_manifest_lists_what_runs_write(tmp_path):
    ours = ["inputs/profile.file/record.parquet", "provenance.json", "study.toml"]
    put(
        tmp_path,
        *ours,
        "mine.parquet",
        "a/b/c/d/e.txt",
        ".shards/x.json",
        "inputs/.x",
        "manifest.json",
    )
    assert visible(place(tmp_path)) == ours


# --- links ----------------------------------------------------------------------------------------


@pytest.fixture
def linked(tmp_path) -> tuple[Place, Path]:
    """A results folder whose folders are links to one of precious files."""
    precious = put(tmp_path / "precious", "thesis.docx", "config.json", "x.json", "x.parquet.part")
    folder = tmp_path / "results"
    folder.mkdir()
    for name in (".tmp", ".locks", ".shards", ".log", "effects", "history", "inputs"):
        (folder / name).symlink_to(precious)
    (folder / "study.toml").symlink_to(precious / "config.json")
    return place(folder), precious


def tries(at: Place) -> dict:
    return {
        "read": lambda: at.read("effects/thesis.docx"),
        "read a link": lambda: at.read("study.toml"),
        "write": lambda: at.write("effects/new.parquet", b"x"),
        "write aside": lambda: at.write("new.txt", b"x"),
        "remove": lambda: at.remove("effects/thesis.docx"),
        "remove a shard": lambda: remove_shard(at, "x.parquet"),
        "names": lambda: at.names("effects"),
        "all names": lambda: at.names(),
        "sweep": at.sweep,
        "lock": lambda: lock.held(at, "run").__enter__(),
        "owners": lambda: lock.owners(at),
    }


@pytest.mark.parametrize("name", tries(place(".")))
def test_no_link_in_a_folder_is_followed(linked, name):
    at, precious = linked
    before = sorted(p.name for p in precious.iterdir())
    with pytest.raises(InputError, match="is a link"):
        tries(at)[name]()
    assert sorted(p.name for p in precious.iterdir()) == before


def test_a_link_in_the_place_of_a_file_is_replaced_or_removed_itself(tmp_path):
    (tmp_path / "precious").write_text("precious", encoding="utf-8")
    for change in (lambda at: at.write("x", b"new"), lambda at: at.remove("x")):
        (tmp_path / "x").unlink(missing_ok=True)
        (tmp_path / "x").symlink_to(tmp_path / "precious")
        change(place(tmp_path))
        assert (tmp_path / "precious").read_text(encoding="utf-8") == "precious"


def test_an_unfinished_file_that_is_a_link_is_not_written_through(tmp_path):
    put(tmp_path, "precious")
    (tmp_path / ".tmp").mkdir()
    (tmp_path / ".tmp" / files.unfinished("x")).symlink_to(tmp_path / "precious")
    place(tmp_path).write("x", b"new")
    assert (tmp_path / "precious").read_text(encoding="utf-8") == "precious"


@pytest.mark.parametrize("name", ["../x", "/etc/hostname", "a/../../x", ""])
def test_no_name_leads_out_of_a_folder(tmp_path, name):
    for use in (
        place(tmp_path).read,
        place(tmp_path).remove,
        lambda n: place(tmp_path).write(n, b""),
    ):
        with pytest.raises(InputError, match="has no file called"):
            use(name)


def test_a_file_for_people_leaves_nothing_beside_it(tmp_path):
    old = os.umask(0o027)
    try:
        files.write_file(tmp_path / "new" / "report.html", b"x")
    finally:
        os.umask(old)
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["report.html"]
    assert (tmp_path / "new" / "report.html").stat().st_mode & 0o777 == 0o640
    (tmp_path / "link.html").symlink_to(tmp_path / "new" / "report.html")
    files.write_file(tmp_path / "link.html", b"y")
    assert (tmp_path / "link.html").is_symlink()
    assert (tmp_path / "new" / "report.html").read_bytes() == b"y"


# --- names ----------------------------------------------------------------------------------------

NAMES = [
    "a--b", "a-b", "a-b-90827a2e", "set2", "set000002", "00000000-00000001", "-", "3973e022", "x" * 60,
    "x" * 61, "a-" * 40, "é", "..", ".a", "97 km/h", "A", "deadbeef", "a-deadbeef", "[/]", "\x1b]0;x\x07",
]  # fmt: skip


def test_names_are_read_as_they_were_made():
    made = {}
    for variant in NAMES:
        for scenario in NAMES:
            for of_set in (None, 0, 3, 1_234_567):
                name = shard_name(variant, scenario, 2048, 123_456_789, of_set)
                parts = ShardName.read(name)
                assert parts == ShardName(slug(variant), slug(scenario), 2048, 123_456_789, of_set)
                assert made.setdefault(name, (variant, scenario, of_set)) == (
                    variant,
                    scenario,
                    of_set,
                )


def test_a_slug_is_nobody_elses_name():
    names = [*NAMES, *(slug(name) for name in NAMES)]
    assert len({slug(name) for name in names}) == len(set(names))
