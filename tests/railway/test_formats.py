"""The formats that the documents show, read as they say."""

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy

from mcsettle.study.study import Study
from mcsettle.summary.spread import line_lengths

ROOT = Path(__file__).resolve().parents[2]
CASES = Path(__file__).parent / "cases"
PAGE = (ROOT / "docs" / "real-input.md").read_text(encoding="utf-8")
BLOCKS = {
    name: tomllib.loads(text)
    for name, text in re.findall(r"```toml\n# (\S+\.csv)\n(.*?)```", PAGE, re.DOTALL)
}
# Sections and length [m].
RIGHT = {
    "km_plus_m.csv": (1, 220.0),
    "miles_yards.csv": (2, 274.3),
    "track_alignment.csv": (5, 1000.0),
}


def study_of(name: str) -> Study:
    data = toy.study().model_dump(by_alias=True, exclude_none=True)
    band = {"longest_m": 25.0} if "already_filtered" in BLOCKS[name] else {}
    data["profile"] = {"file": name, "record": BLOCKS[name], **band}
    return Study.from_mapping(data | {"limit": {"sd_limit_mm": 50.0}}, folder=CASES)


def record_of(name: str) -> Any:
    return study_of(name).record()


def test_a_measured_line_is_as_long_as_it_is() -> None:
    assert line_lengths(record_of("track_alignment.csv")) == (0.2, 1.0)
    assert line_lengths(record_of("miles_yards.csv")) == (0.2, 0.274)
    assert line_lengths(None) == (0.2, 1.0, 10.0, 100.0)


def test_every_file_has_its_block_and_its_right_answer() -> None:
    assert set(BLOCKS) == set(RIGHT) == {path.name for path in CASES.glob("*.csv")}


@pytest.mark.parametrize("name", RIGHT)
def test_a_format_is_read_as_the_page_says(name: str) -> None:
    record = record_of(name)
    parts = record.sections
    n, length = RIGHT[name]
    assert len(parts.sd) == n
    assert len(parts.chainage) * parts.step == pytest.approx(length, abs=1.0)
    assert {f.kind for f in record.findings} <= {"missing", "gaps"}
    assert np.all(np.isfinite(parts.amplitudes))


def test_the_worse_rail_is_the_one_that_was_written_larger() -> None:
    """The right rail is 1.1 times the left one; what lies in no section is said."""
    record = record_of("km_plus_m.csv")
    run = record.run
    np.testing.assert_allclose(run.other_rail, 1.1 * run.level, atol=1.1e-6)
    whole = record.sections.passed[:800]
    assert record.sections.sd[0] == pytest.approx(np.std(whole), rel=1e-9)
    left = run.level[run.chainage < 752_200.0]
    assert record.sections.sd[0] == pytest.approx(1.1 * np.std(left), rel=0.01)
    assert any("20 m at the end" in remark for remark in record.remarks)
