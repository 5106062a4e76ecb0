"""A value and its error as they are written, everywhere."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcsettle.estimate.estimate import Estimate
from mcsettle.estimate.rounding import number, with_error


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (697.4, 11.24, "697 ± 11"),
        (1463.2, 283.1, "1460 ± 280"),  # once "1460 ± 2.8e+02"
        (44.7, 1.5e-15, "44.7"),  # once "44.7 ± 1.5e-15"
        (-2.0, 0.0996, "−2.00 ± 0.10"),
        (0.0, 0.00213, "0.0000 ± 0.0021"),
        (0.3, 12.0, "0 ± 12"),
        (123456.0, 2345.0, "123500 ± 2300"),
        (4.032e-7, 1.2e-8, "(4.03 ± 0.12)e−7"),
        (5.0, None, "5.00"),
        (None, 1.0, "not reached"),
        (5.0, float("nan"), "5.00"),
    ],
)
def test_digits_follow_the_error(value: float | None, error: float | None, text: str) -> None:
    assert with_error(value, error) == text
    assert Estimate(value, None, None, error, 9, 0, "d").with_error() == text


@given(st.floats(1e-3, 1e6, exclude_max=True), st.floats(1e-8, 1e5))
def test_no_exponent_between_a_thousandth_and_a_million(value: float, error: float) -> None:
    text = with_error(value, error)
    assert "e" not in text
    if "±" in text:
        digits = re.sub(r"\D", "", text.split("±")[1]).lstrip("0").rstrip("0")
        assert 1 <= len(digits) <= 2


@given(st.floats(-1e300, 1e300, allow_subnormal=False))
def test_every_number_can_be_written_and_is_near(value: float) -> None:
    written = float(number(value).replace("−", "-"))
    assert written == pytest.approx(value, rel=5.1e-3)
