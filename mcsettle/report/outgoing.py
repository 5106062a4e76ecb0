"""Texts as they leave: for a terminal, Markdown, CSV, HTML. Studies and folders come from others too.

A text is data wherever it goes: it moves no cursor, fills no clipboard, makes no heading, no link, no
formula and no markup. What can be seen of it stays as it is.
"""

import csv
import io
import re
import unicodedata
from collections.abc import Iterable, Sequence

REPLACED = "\ufffd"  # stands for a character that is not shown
# Characters that turn the direction of a text or have no width, and so hide what stands there.
_UNSEEN = re.compile(
    "[\u00ad\u061c\u180e\u200b\u200e\u200f\u202a-\u202e\u2060-\u2064\u2066-\u206f\ufeff]"
)
_CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")
_FORMULA = re.compile(r"[\t\r=+\-@\ufe62\ufe63\ufe66\ufe6b\uff0b\uff0d\uff1d\uff20]")
_MARKS = re.compile(r"([\\`*_|\[\]~])")
_BLOCK = re.compile(r"^(\s*)(?:([0-9]{1,9})([.)])(?=\s|$)|(#{1,6}(?=\s|$)|[-+](?=[\s-]|$)))")
_LINK = re.compile(r"://|(?<=www)\.|@", re.IGNORECASE)


def lines(text: str) -> str:
    r"""``text`` for a terminal: its own lines, and nothing that the terminal would obey.

    >>> lines("title\x1b]52;c;eA==\x07")
    'title�]52;c;eA==�'
    """
    return _UNSEEN.sub(REPLACED, _CONTROLS.sub(REPLACED, text.replace("\r\n", "\n")))


def plain(text: str) -> str:
    """``text`` on one line, for a terminal or a cell."""
    return lines(re.sub(r"[\n\t\r\u2028\u2029]", " ", text))


def json_text(text: str) -> str:
    """JSON ``text`` whose strings hold escapes where a terminal would obey, and so the same data."""
    return re.sub(
        f"{_CONTROLS.pattern}|{_UNSEEN.pattern}", lambda sign: f"\\u{ord(sign[0]):04x}", text
    )


def markdown(text: str) -> str:
    r"""``text`` as a paragraph or cell of Markdown: no markup, link, list, heading or new line.

    >>> print(markdown("# a *b*"), markdown("http://x"))
    \# a \*b\* http:&#47;&#47;x
    """
    text = _MARKS.sub(r"\\\1", plain(text)).replace("<", "&lt;").replace(">", "&gt;")
    text = _LINK.sub(lambda sign: "".join(_entity(c) if c in "/.@" else c for c in sign[0]), text)
    return _BLOCK.sub(lambda sign: f"{sign[1]}{sign[2] or ''}\\{sign[3] or sign[4]}", text)


def csv_cell(text: str) -> str:
    """``text`` as a cell: one that a spreadsheet might take for a formula gets an apostrophe.

    Spreadsheets pass over blanks and what has no width, and some read full-width signs.
    """
    begun = next((c for c in text if not _is_passed_over(c)), "")
    return f"'{text}" if _FORMULA.match(begun) or (text[:1] in "\t\r" and text) else text


def csv_text(heading: Sequence[str], rows: Iterable[Sequence[object]], end: str = "\r\n") -> str:
    """A table as CSV with lines that ``end`` so (RFC 4180: CR LF), its texts as ``csv_cell`` has them."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator=end)
    writer.writerow(heading)
    for row in rows:
        writer.writerow([csv_cell(value) if isinstance(value, str) else value for value in row])
    return stream.getvalue()


def _is_passed_over(character: str) -> bool:
    kind = unicodedata.category(character)
    return kind in ("Cc", "Cf", "Zs", "Zl", "Zp") and character not in "\t\r"


def _entity(character: str) -> str:
    return f"&#{ord(character)};"
