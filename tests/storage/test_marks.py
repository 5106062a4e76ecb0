"""Reports, pictures and workbooks replace what bears the mark of their study, and nothing else."""

import io
from pathlib import Path

import pytest
from matplotlib import image
from matplotlib.figure import Figure

from mcsettle.errors import InputError
from mcsettle.report.figures.style import drawn
from mcsettle.storage.marks import mark_of, marked, refuse_others, write_marked

OURS, OTHER = "a1" * 32, "b2" * 32


def plain(kind: str) -> bytes:
    """A file of a kind as its writer leaves it."""
    if kind in (".png", ".svg", ".pdf"):
        figure = Figure()
        figure.subplots().plot([0, 1])
        return drawn(figure, kind.lstrip("."))
    return {".html": b"<!doctype html><html><head></head></html>", ".md": b"# Title\n"}[kind]


@pytest.mark.parametrize("kind", [".html", ".md", ".png", ".svg", ".pdf"])
def test_a_mark_is_read_where_it_was_put(tmp_path, kind):
    path = tmp_path / f"file{kind}"
    path.write_bytes(plain(kind))
    assert mark_of(path) is None
    with pytest.raises(InputError, match="is there already and is not written by mcsettle"):
        write_marked({path: plain(kind)}, OURS)
    assert path.read_bytes() == plain(kind)
    write_marked({path: plain(kind)}, OTHER, force=True)
    assert mark_of(path) == OTHER
    with pytest.raises(InputError, match="is there already and is of another study"):
        write_marked({path: plain(kind)}, OURS)
    write_marked({path: plain(kind)}, OURS, force=True)
    write_marked({path: plain(kind)}, OURS)
    assert mark_of(path) == OURS
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_a_marked_picture_is_the_same_picture():
    before, after = plain(".png"), marked(plain(".png"), ".png", OURS)
    assert (image.imread(io.BytesIO(before)) == image.imread(io.BytesIO(after))).all()


def test_nothing_is_written_where_one_file_is_not_ours(tmp_path):
    (tmp_path / "README.md").write_text("# precious\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"README\.md' is there already"):
        write_marked({tmp_path / "new.html": plain(".html"), tmp_path / "README.md": b"x"}, OURS)
    assert [p.name for p in tmp_path.iterdir()] == ["README.md"]


def test_files_without_a_place_go_by_a_marked_one(tmp_path):
    files = {tmp_path / "a.png": plain(".png"), tmp_path / "a.csv": b"x\n"}
    write_marked(files, OURS)
    write_marked(files, OURS)
    (tmp_path / "a.png").unlink()
    with pytest.raises(
        InputError, match=r"a\.csv' is there already and is not written by mcsettle"
    ):
        write_marked(files, OURS)


@pytest.mark.parametrize("content", [b"", b"PK\x05\x06" + bytes(18), b"PK", b"\0" * 100])
def test_what_is_no_file_of_ours_is_refused_whatever_it_is(tmp_path, content):
    path = tmp_path / "x.xlsx"
    path.write_bytes(content)
    (tmp_path / "dangling.html").symlink_to(tmp_path / "none")
    (tmp_path / "folder.html").mkdir()
    for other in (path, tmp_path / "dangling.html", tmp_path / "folder.html"):
        with pytest.raises(InputError, match="is there already"):
            refuse_others([other], OURS)
    refuse_others([Path(tmp_path / "new.html")], OURS)
