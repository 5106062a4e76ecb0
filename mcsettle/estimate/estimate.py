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

from dataclasses import dataclass

import numpy as np

LEVELS = (0.05, 0.5, 0.95)
CONFIDENCE = 0.95


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
        if not self.standard_error:
            spread = " ± 0" if self.standard_error == 0.0 else ""
            return f"{self.value:.6g}{spread} {self.unit} ({counts}{remark})"
        places = max(0, 1 - int(np.floor(np.log10(self.standard_error))))
        return (
            f"{self.value:.{places}f} ± {self.standard_error:.{places}f} {self.unit} "
            f"({counts}{remark})"
        )

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
