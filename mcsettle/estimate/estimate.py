"""Estimates from realisations: a value, its confidence interval, its standard error, its unit.

Censored intervals keep their place: quantiles come from the Kaplan–Meier curve, and one beyond its
last event is "not reached", never the horizon; means are restricted means. Nothing assumes a
distribution. The standard error of a quantile is Maritz and Jarrett's, with the steps of the
Kaplan–Meier curve as weights; where too much of it lies beyond the last event, and for effects
with censored pairs, it is the width of the confidence interval divided by 2z (one side of it where
the other is open). Confidence limits that the sample is too small to give, or that lie beyond the
horizon, are None: that side is open.

References: Maritz and Jarrett (1978), A note on estimating the variance of the sample median,
Journal of the American Statistical Association 73, 194–196.
"""

import math
from dataclasses import dataclass

from mcsettle.estimate.rounding import NOT_REACHED, decimals, is_error, number, with_error

LEVELS = (0.05, 0.5, 0.95)
CONFIDENCE = 0.95


def finite(value: float | None) -> float | None:
    """The number; None for an infinite or undefined one."""
    return float(value) if value is not None and math.isfinite(value) else None


@dataclass(frozen=True)
class Estimate:
    """A number with its Monte Carlo error.

    ``value``, ``lower``, ``upper`` and ``standard_error`` share ``unit``; None means not identified
    (``value``), open (``lower``, ``upper``) or unknown (``standard_error``), and ``note`` says why.
    ``n`` counts realisations, ``n_censored`` those of them that ran into their horizon.
    """

    value: float | None
    lower: float | None
    upper: float | None
    standard_error: float | None
    n: int
    n_censored: int
    unit: str
    note: str = ""

    def __str__(self) -> str:
        """Value ± standard error, both rounded to two digits of the error."""
        counts = f"n = {self.n}" + (f", {self.n_censored} censored" if self.n_censored else "")
        remark = f"; {self.note}" if self.note else ""
        if self.value is None:
            return f"not identified ({counts}{remark})"
        if is_error(self.value, self.standard_error):
            return f"{self.with_error()} {self.unit} ({counts}{remark})"
        exact = "" if self.standard_error is None else " ± 0"
        return f"{self.value:.6g}{exact} {self.unit} ({counts}{remark})"

    def places(self, factor: float = 1.0) -> int | None:
        """Decimals that show two digits of the error times ``factor``; None without an error."""
        if self.value is None or self.standard_error is None:
            return None
        known = is_error(self.value, self.standard_error)
        return decimals(self.standard_error * abs(factor)) if known else None

    def with_error(self, empty: str = NOT_REACHED, factor: float = 1.0) -> str:
        """Value ± standard error, both times ``factor``; ``empty`` where there is no value."""
        return with_error(self.value, self.standard_error, empty, factor)

    def with_interval(self, between: str = " ", empty: str = "–") -> str:
        """Value and its 95 % interval, to two digits of the error; an end not known is open."""
        if self.value is None:
            return empty
        places = self.places()
        low, high = (number(end, places, "open") for end in (self.lower, self.upper))
        return f"{number(self.value, places)}{between}[{low}, {high}]"

    @property
    def relative_error(self) -> float | None:
        """Standard error over value, for rules that stop at a precision."""
        if self.value is None or self.standard_error is None or self.value == 0.0:
            return None
        return self.standard_error / abs(self.value)


@dataclass(frozen=True)
class Statistic:
    """An estimate and what it is: ``quantile`` at ``level``, ``mean``, ``restricted_mean``, others.

    ``subject`` names an input or a length of line where the statistic is about one.
    """

    statistic: str
    level: float | None
    estimate: Estimate
    subject: str = ""
