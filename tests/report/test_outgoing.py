"""A text of somebody else's is shown, and obeyed nowhere."""

import re

import pytest

from mcsettle.report.outgoing import csv_cell, json_text, lines, markdown, plain

ESC = "\x1b]52;c;aGk=\x07"  # fills the clipboard of a terminal that obeys
HIDDEN = [
    "\u202e",
    "\u200b",
    "\ufeff",
    "\u2066",
    "\x9b",
    "\x7f",
    "\x00",
    "\x1b",
    "\r",
    "\x08",
    "\ud800",
]


@pytest.mark.parametrize("sign", HIDDEN)
@pytest.mark.parametrize("leave", [lines, plain, markdown])
def test_what_a_terminal_or_a_reader_would_obey_is_replaced(leave, sign):
    assert sign not in leave(f"a{sign}b")
    assert leave("déjà vu ½ → 3 µm") == "déjà vu ½ → 3 µm"


def test_a_clipboard_is_not_filled():
    assert "\x1b" not in lines(f"a\n{ESC}")
    assert lines("a\n\tb") == "a\n\tb"
    assert plain("a\nb\r\nc") == "a b  c"


def test_json_keeps_its_data():
    import json

    data = {"title": "a\x1b\x9b\u202e\x7fé", "n": [1, "\n"]}
    text = json_text(json.dumps(data, ensure_ascii=False))
    assert json.loads(text) == data
    assert re.search("[\x1b\x9b\u202e\x7f]", text) is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("# a", r"\# a"),
        ("a\n# b", "a # b"),
        ("a\n===", "a ==="),
        ("- a", r"\- a"),
        ("---", r"\---"),
        ("1. a", r"1\. a"),
        ("12) a", r"12\) a"),
        ("1.5 mm", "1.5 mm"),
        ("-5 mm", "-5 mm"),
        ("> a", "&gt; a"),
        ("<b>", "&lt;b&gt;"),
        ("a|b", r"a\|b"),
        ("*a* _b_ `c` ~~d~~ [e](f)", r"\*a\* \_b\_ \`c\` \~\~d\~\~ \[e\](f)"),
        ("http://x.y", "http:&#47;&#47;x.y"),
        ("www.x.y a@b.c", "www&#46;x.y a&#64;b.c"),
    ],
)
def test_markdown_is_text(text, said):
    assert markdown(text) == said


@pytest.mark.parametrize(
    "blank", ["", " ", "\u00a0", "\ufeff", "\u200b", "\u2060 ", "\n", "\u3000"]
)
@pytest.mark.parametrize("sign", [*"=+-@＝＋－＠﹦﹢﹣﹫", "\t", "\r"])
def test_no_cell_becomes_a_formula(blank, sign):
    assert csv_cell(f"{blank}{sign}1") == f"'{blank}{sign}1"


@pytest.mark.parametrize("text", ["", "a=1", "1-2", " a", "v201", "é", "−5"])
def test_other_cells_stay(text):
    assert csv_cell(text) == text
