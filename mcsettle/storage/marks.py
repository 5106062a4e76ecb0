"""Files for people (reports, pictures, workbooks) bear the mark of their study, and replace only such.

The mark stands where a kind of file keeps what is said about it: a ``meta`` of HTML, a text chunk of
PNG, a comment of SVG, Markdown and PDF, a property of a workbook, the key-value metadata of Parquet. CSV
and JSON have no such place: they go by a marked file that is written beside them.
"""

import os
import re
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from mcsettle.errors import InputError
from mcsettle.storage.files import write_file

NAME = "mcsettle-study"
NO_STUDY = "0" * 64  # mark of what belongs to none
BARE = (".csv", ".json")  # kinds of files without a place for a mark
PLACES = (".html", ".png", ".svg", ".md", ".pdf")
_MARK = re.compile(rb"mcsettle-study.{1,40}?([0-9a-f]{64})", re.DOTALL)
_ENDS = 65_536  # bytes at either end of a file in which a mark is looked for
_PROPERTIES = "docProps/custom.xml"  # of a workbook
_LARGEST_PROPERTIES = 100_000
_PNG_HEAD = 33  # bytes of the signature and the first chunk


def marked(data: bytes, kind: str, study: str) -> bytes:
    """``data`` of a file of ``kind`` (its ending) with the mark of ``study`` (SHA-256, hex)."""
    text = f"{NAME}: {study}".encode()
    match kind.lower():
        case ".html":
            meta = f'<meta name="{NAME}" content="{study}">'.encode()
            return data.replace(b"<head>", b"<head>\n" + meta, 1)
        case ".png":
            body = b"tEXt" + NAME.encode() + b"\0" + study.encode()
            chunk = (len(body) - 4).to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")
            return data[:_PNG_HEAD] + chunk + data[_PNG_HEAD:]
        case ".svg" | ".md":
            return data.rstrip(b"\n") + b"\n\n<!-- " + text + b" -->\n"
        case ".pdf":
            return data.rstrip(b"\n") + b"\n% " + text + b"\n"
    raise ValueError(f"{kind} has no place for a mark here")


def write_marked(files: Mapping[Path, bytes], study: str, force: bool = False) -> list[Path]:
    """Write files for people, each with the mark of ``study`` where its kind has a place for it.

    Raises
    ------
    InputError
        As ``refuse_others``, before the first is written; a folder cannot be written.
    """
    refuse_others(list(files), study, force)
    return [
        write_file(path, marked(data, path.suffix, study) if path.suffix in PLACES else data)
        for path, data in files.items()
    ]


def mark_of(path: Path) -> str | None:
    """Study that the file at ``path`` is marked with; None where it bears no mark, or is no file."""
    try:
        if not path.is_file():
            return None
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as book, book.open(_PROPERTIES) as source:
                text = source.read(_LARGEST_PROPERTIES)
        else:
            with path.open("rb") as source:
                text = source.read(_ENDS)
                source.seek(max(0, path.stat().st_size - _ENDS))
                text += source.read(_ENDS)
    except (OSError, KeyError, ValueError, RuntimeError, zipfile.BadZipFile, zlib.error):
        return None
    mark = _MARK.search(text)
    return None if mark is None else mark[1].decode()


def refuse_others(paths: Sequence[Path], study: str, force: bool = False) -> None:
    """Refuse to replace what is not ours of the same study; ``force``: the user says so.

    Raises
    ------
    InputError
        The message names the first such file.
    """
    if force:
        return
    marks = {path: mark_of(path) for path in paths if os.path.lexists(path)}
    ours = study in marks.values()
    for path, mark in marks.items():
        if mark == study or (mark is None and ours and path.suffix.lower() in BARE):
            continue
        what = "not written by mcsettle" if mark is None else "of another study"
        raise InputError(
            f"'{path}' is there already and is {what}; name another file, or give force= to replace it"
        )
