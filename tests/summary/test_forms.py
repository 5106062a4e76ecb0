"""Model forms together: what settles a sign, what a range is, and when a price is supported."""

import pytest

from mcsettle.estimate.estimate import Estimate
from mcsettle.summary.forms import FormEffect, summarise_forms


def effect(
    form: str,
    price: float | None,
    shortens: float | tuple[float, float] = 0.99,
    calibrated: bool = True,
) -> FormEffect:
    """An effect of a line price; ``shortens`` the share of the sections."""
    found = Estimate(price, price, price, 0.01, 100, 0 if price is not None else 60, "1")
    share = shortens if isinstance(shortens, tuple) else (shortens, shortens)
    middle = None if price is None else 0.9 * price
    return FormEffect(form, found, None, (None, middle, None), None, share, calibrated)


@pytest.mark.parametrize(
    ("effects", "verdict", "settled"),
    [
        # Settled with one sign in every form, and the largest at most twice the smallest.
        ([("a", 1.0, 0.99), ("b", 2.0, 0.96)], "yes", 2),
        ([("a", -1.0, 0.01), ("b", -2.0, 0.04)], "yes", 2),
        ([("a", 1.0, 0.99), ("b", 2.01, 0.99)], "as a range", 2),
        ([("a", 1.0, 0.99), ("b", -1.0, 0.01)], "as a range", 2),
        # The sections agree and the mean does not: one number would mislead.
        ([("a", 1.0, 0.99), ("b", -0.9, 0.96)], "as a range", 2),
        # P must lie above 95 % or below 5 %: at 95 % itself nothing is settled.
        ([("a", 1.0, 0.99), ("b", 1.0, 0.95)], "as a range", 1),
        ([("a", 1.0, 0.99), ("b", 1.0, 0.5), ("c", 1.0, 0.5)], "no", 1),
        ([("a", 1.0, 0.5), ("b", 1.0, 0.5)], "no", 0),
        # Any price only a bound.
        ([("a", 1.0, 0.99), ("b", None, 0.99)], "no", 2),
        # One form never says yes.
        ([("a", 1.0, 1.0)], "as a range", 1),
        ([("a", 1.0, 0.6)], "no", 0),
        ([], "no", 0),
    ],
)
def test_verdict(effects, verdict, settled) -> None:
    found = summarise_forms("C", [effect(*entry) for entry in effects])
    assert (found.verdict, found.settled) == (verdict, settled)
    assert found.reason


def test_censored_sections_leave_a_sign_open() -> None:
    """Settled means settled whatever the censored sections would do."""
    assert effect("a", 1.0, (0.96, 1.0)).sign == 1
    assert effect("a", 1.0, (0.90, 1.0)).sign == 0
    assert effect("a", -1.0, (0.0, 0.04)).sign == -1


def test_range_is_of_the_calibrated_forms() -> None:
    effects = [effect("a", 1.0), effect("b", 1.5), effect("plain", 90.0, calibrated=False)]
    found = summarise_forms("C", effects)
    assert [e.form for e in found.effects] == ["a", "b"]
    assert found.prices == (1.0, 1.5)
    assert found.medians == pytest.approx((0.9, 1.35))
    assert found.verdict == "yes"


def test_a_range_with_a_bound_in_it_is_not_stated() -> None:
    assert summarise_forms("C", [effect("a", 1.0), effect("b", None)]).prices is None
