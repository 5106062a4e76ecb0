"""Model forms as one thing: what a price is worth once the choice of model is counted.

A form is one reading of the same question, calibrated to the same observation by a settlement factor of
its own. What the choice of form moves is usually larger than what the sample moves, and no larger
sample narrows it. From the price and the sign that each form gives follow the range over the forms, the
number of forms in which the sign is settled, and whether the price may be used.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from mcsettle.estimate.estimate import Estimate

SETTLED = 0.95  # share of the sections that must move the same way
WIDEST = 2.0  # largest over smallest line mean that one price may stand for

Verdict = Literal["yes", "as a range", "no"]


@dataclass(frozen=True)
class FormEffect:
    """One scenario against its baseline in one form.

    ``price`` is the mean over the line with its 95 % interval, ``value`` None where most pairs of
    sections are censored; ``at_most`` then bounds it from above (None: no bound either). ``sections``
    [P5, P50, P95] of the price between sections, in the unit of ``price``; ``reduction`` the median
    reduction of the interval [%], None where censored pairs decide it; ``shortens`` the least and
    largest share of the sections whose interval shortens, the censored ones being unknown.
    ``calibrated``: its factor was fitted.
    """

    form: str
    price: Estimate
    at_most: float | None
    sections: tuple[float | None, float | None, float | None]
    reduction: float | None
    shortens: tuple[float, float]
    calibrated: bool = True

    @property
    def sign(self) -> int:
        """1: the interval shortens, −1: it lengthens, 0: not settled."""
        if self.shortens[0] > SETTLED:
            return 1
        return -1 if self.shortens[1] < 1.0 - SETTLED else 0


@dataclass(frozen=True)
class FormsSummary:
    """What all forms say of one scenario, and whether a price is supported.

    ``effects`` are of the forms that count (the calibrated ones); ``prices`` [lowest, highest] line
    mean over them, None where one is only a bound; ``settled`` of them know the sign.
    """

    scenario: str
    effects: tuple[FormEffect, ...]
    prices: tuple[float, float] | None
    medians: tuple[float, float] | None
    settled: int
    verdict: Verdict
    reason: str


def summarise_forms(scenario: str, effects: Sequence[FormEffect]) -> FormsSummary:
    """The forms of one question together.

    Parameters
    ----------
    scenario : the scenario the effects are of
    effects : of every form; those that are not calibrated do not count

    Returns
    -------
    FormsSummary
        Verdict *yes*: the sign is the same and settled in every form, and the largest line mean is at
        most twice the smallest. *No*: any price is only a bound, or fewer than half of the forms are
        settled. *As a range*: the rest; a single form never says yes.
    """
    counted = tuple(effect for effect in effects if effect.calibrated)
    settled = sum(effect.sign != 0 for effect in counted)
    verdict, reason = _verdict(counted, settled)
    prices = _range([effect.price.value for effect in counted])
    medians = _range([effect.sections[1] for effect in counted])
    return FormsSummary(scenario, counted, prices, medians, settled, verdict, reason)


def _verdict(counted: Sequence[FormEffect], settled: int) -> tuple[Verdict, str]:
    n = len(counted)
    if n == 0:
        return "no", "no model form is calibrated to an observation"
    bounds = sum(effect.price.value is None for effect in counted)
    if bounds:
        return "no", f"the price is only a bound in {_of(bounds, n)}"
    if n == 1 and not settled:
        return "no", "the sign is open: fewer than 95 % of the sections agree"
    if 2 * settled < n:
        return "no", f"the sign is settled in {_of(settled, n)}"
    if n == 1:
        return "as a range", "there is one model form only, and its choice can move the price"
    if settled < n:
        return "as a range", f"the sign is settled in {_of(settled, n)}"
    if len({effect.sign for effect in counted}) > 1:
        return "as a range", "a cost in some model forms and a saving in others"
    sizes = [abs(effect.price.value or 0.0) for effect in counted]
    signs = {(effect.price.value or 0.0) > 0.0 for effect in counted}
    if len(signs) > 1 or max(sizes) > WIDEST * min(sizes):
        return "as a range", "the largest price is more than twice the smallest"
    return "yes", f"all {n} model forms agree in sign and to within a factor of {WIDEST:g}"


def _of(part: int, n: int) -> str:
    return f"{part or 'none'} of {n} model form{'s' if n > 1 else ''}"


def _range(values: Sequence[float | None]) -> tuple[float, float] | None:
    numbers = [value for value in values if value is not None]
    return (min(numbers), max(numbers)) if numbers and len(numbers) == len(values) else None
