"""Tables that people have as text: encodings, separators, and numbers as they are written.

What cannot be read is said in the owner's words, with the line and the key that would read it; every
fault of a file is in one refusal.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mcsettle.errors import InputError

SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
ENCODINGS = ("utf-8", "utf-16", "cp1252", "cp1250", "iso-8859-1", "iso-8859-15", "cp850")
MISSING = ("", "NaN", "nan", "NA", "null", "-")  # always read as no number
MOST_FAULTS = 20
_NUMBER = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?$"
_SPACES = "  "  # no-break spaces, which spreadsheets write between thousands
_GROUPS = {",": "','", ".": "'.'", "'": '"\'"', " ": "' '"}


@dataclass(frozen=True)
class NumberFormat:
    """How numbers are written: decimal sign, sign between thousands, texts that mean no reading."""

    decimal: str = "."
    thousands: str | None = None
    missing: tuple[str | float, ...] = ()


def refused(path: Path | str, faults: Sequence[str]) -> InputError:
    """The error that lists every one of ``faults`` of the file at ``path``."""
    if len(faults) == 1:
        return InputError(f"{_name(path)}: {faults[0]}")
    shown = [f"  {fault}" for fault in faults[:MOST_FAULTS]]
    if len(faults) > MOST_FAULTS:
        shown.append(f"  … and {len(faults) - MOST_FAULTS} more")
    return InputError("\n".join([f"{_name(path)} cannot be used ({len(faults)} faults):", *shown]))


def encoding_of(start: bytes, stated: str | None) -> str:
    r"""Codec of a file from its first bytes: its byte order mark, else ``stated``, else UTF-8.

    >>> encoding_of(b"\xef\xbb\xbfkm", None), encoding_of(b"\xff\xfek\x00", None)
    ('utf-8-sig', 'utf-16')
    """
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    if start[:3] == b"\xef\xbb\xbf" or stated in (None, "utf-8"):
        return "utf-8-sig"
    return str(stated)


def decoded(data: bytes, stated: str | None) -> str:
    """Text of ``data``, in the encoding of its byte order mark, the ``stated`` one, or UTF-8.

    Raises
    ------
    InputError
        The bytes are of another encoding; the one that they may be of is named.
    """
    try:
        return data.decode(encoding_of(data, stated))
    except UnicodeDecodeError as error:
        raise InputError(foreign_bytes(data, error)) from None


def foreign_bytes(data: bytes, error: UnicodeDecodeError) -> str:
    """What to say of bytes that are not of the encoding they were read as."""
    line = data.count(b"\n", 0, error.start) + 1
    begin = data.rfind(b"\n", 0, error.start) + 1
    piece = data[max(begin, error.start - 20) : error.start + 20].split(b"\n")[0]
    if b"\x00" in data[:200]:
        return 'is UTF-16 text without a byte order mark; say encoding = "utf-16", or save as UTF-8'
    name = "UTF-8" if error.encoding.startswith("utf-8") else error.encoding
    return (
        f"line {line} is not {name} (byte 0x{data[error.start]:02x}); as Windows-1252 it reads "
        f"'{piece.decode('cp1252', 'replace').strip()}': say encoding = \"cp1252\" (accepted: "
        f"{', '.join(ENCODINGS)}), or save the file as UTF-8"
    )


def sniffed(lines: Sequence[str]) -> tuple[str, int] | None:
    """Separator (a key of ``SEPARATORS``) and place of the heading among the first ``lines``.

    The separator is the one that cuts most lines into the same number of cells; the heading is the
    first line with that number. None: nothing separates.

    >>> sniffed(["made in May", "a;b", "1,5;2", "2,0;3"])
    ('semicolon', 1)
    """
    best: tuple[int, str, int] | None = None
    for name, sign in SEPARATORS.items():
        counts = [len(cells(line, sign)) for line in lines if line.strip()]
        usual, times = max(
            Counter(n for n in counts if n > 1).items(), key=lambda kv: kv[1], default=(0, 0)
        )
        if times and (best is None or times > best[0]):
            best = (times, name, usual)
    if best is None:
        return None
    sign = SEPARATORS[best[1]]
    places = [i for i, line in enumerate(lines) if len(cells(line, sign)) == best[2]]
    return best[1], places[0]


def cells(line: str, separator: str) -> list[str]:
    """Cells of one line, quotes taken off."""
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]


def numbers(texts: Any, layout: NumberFormat) -> tuple[np.ndarray, np.ndarray]:
    """Numbers [N] of an Arrow column of texts, NaN where there is none, and which cannot be read [N]."""
    import pyarrow as pa
    import pyarrow.compute as pc

    texts = pc.fill_null(pc.utf8_trim_whitespace(texts), "")
    absent = pc.is_in(
        texts, pa.array([*MISSING, *(m for m in layout.missing if isinstance(m, str))])
    )
    plain = pc.replace_substring(texts, "−", "-")
    if layout.thousands is not None:
        signs = [" ", *_SPACES] if layout.thousands == " " else [layout.thousands]
        for sign in signs:
            plain = pc.replace_substring(plain, sign, "")
    if layout.decimal != ".":
        # A point is no decimal sign here: it must not slip through as one.
        plain = pc.replace_substring(pc.replace_substring(plain, ".", "?"), layout.decimal, ".")
    readable = pc.match_substring_regex(plain, _NUMBER)
    kept = pc.and_(readable, pc.invert(absent))
    values = pc.cast(pc.if_else(kept, plain, pa.scalar(None, pa.string())), pa.float64())
    array = np.array(pc.fill_null(values, np.nan).to_numpy(), dtype=float)
    array = without_marks(array, layout)
    wrong = ~np.asarray(pc.or_(kept, absent).to_numpy(zero_copy_only=False), dtype=bool)
    return array, wrong | np.isinf(array)


def without_marks(values: np.ndarray, layout: NumberFormat) -> np.ndarray:
    """``values`` [N] with NaN for every number that means that nothing was read."""
    marks = [mark for mark in (_as_number(m, layout) for m in layout.missing) if mark is not None]
    return np.where(np.isin(values, marks), np.nan, values) if marks else values


def number_fault(
    name: str, texts: Sequence[str], lines: Sequence[int], layout: NumberFormat
) -> str:
    """What to say of the ``texts`` that are no numbers, in lines ``lines`` of the file.

    ``texts`` are the different ones, the most frequent first; the way to read them is named where
    their form shows it.
    """
    quoted = ", ".join(f"'{text[:40]}'" for text in texts[:3])
    more = f" and {len(texts) - 3} other texts" if len(texts) > 3 else ""
    count = f"{len(lines)} cells are" if len(lines) > 1 else "one cell is"
    said = f"column '{name}': {count} no finite number, first in line {lines[0]}: {quoted}{more}"
    advice = list(dict.fromkeys(_advice(text, layout) for text in texts[:3]))
    return f"{said}; {'; '.join(advice)}"


def counted(texts: Iterable[str]) -> list[str]:
    """Different ``texts``, the most frequent first."""
    return [text for text, _ in Counter(texts).most_common()]


def _advice(text: str, layout: NumberFormat) -> str:
    other = "," if layout.decimal == "." else "."
    sign = re.escape(other)
    for group, quoted in _GROUPS.items():
        between = f"[{_SPACES} ]" if group == " " else re.escape(group)
        whole = rf"[+-]?\d{{1,3}}({between}\d{{3}})+"
        if group != layout.decimal and re.fullmatch(
            whole + rf"{re.escape(layout.decimal)}\d+", text
        ):
            return f"the thousands are separated: thousands = {quoted}"
        if group != other and re.fullmatch(whole + rf"{sign}\d+", text):
            return f'write decimal = "{other}", thousands = {quoted}'
    if re.fullmatch(rf"[+-]?\d*{sign}\d+([eE][+-]?\d+)?", text):
        return f'the decimal sign is a {"comma" if other == "," else "point"}: decimal = "{other}"'
    if re.fullmatch(r"\d+\s*\+\s*\d+([.,]\d+)?", text):
        return 'that is kilometre and metres: chainage_unit = "km+m"'
    if re.fullmatch(r"\d+\s*m(i|iles?)?\.?\s+\d+(\.\d+)?\s*(ch|c|chains?)\.?", text, re.IGNORECASE):
        return 'that is miles and chains: chainage_unit = "mi.ch"'
    if re.fullmatch(r"\d+\s*m(i|iles?)?\.?\s+\d+(\.\d+)?\s*(yd|y|yards?)\.?", text, re.IGNORECASE):
        return 'that is miles and yards: chainage_unit = "mi.yd"'
    if re.fullmatch(r"[+-]?\d+([.,]\d+)?\s*(mm|cm|m|km|in|ft|yd|mi)", text):
        return "leave the unit out of the cells"
    if re.fullmatch(r"\[.+\]|\(.+\)|mm|cm|m|km|in|ft|yd|mi", text):
        return "a row of units below the heading is passed over by skip_after_heading = 1"
    return f'where "{text[:40]}" means that nothing was read, name it: missing_values = ["{text[:40]}"]'


def _name(path: Path | str) -> str:
    return path if isinstance(path, str) else path.name


def _as_number(mark: str | float, layout: NumberFormat) -> float | None:
    """The number that a mark of no reading stands for; None where it is a word."""
    if not isinstance(mark, str):
        return float(mark)
    text = mark.strip()
    if layout.decimal != ".":
        text = text.replace(layout.decimal, ".")
    return float(text) if re.fullmatch(_NUMBER, text) else None
