"""One verification case: an expected and an obtained number, and how far they may differ."""

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Case:
    """Outcome of one verification case.

    ``expected`` and ``obtained`` in ``unit`` (complex for harmonic quantities); ``tolerance`` is relative
    to ``scale`` (the largest value of the curve from which the point was taken).
    """

    name: str
    source: str
    expected: complex
    obtained: complex
    tolerance: float
    unit: str
    scale: float

    @property
    def error(self) -> float:
        """|obtained - expected| over ``scale``."""
        return abs(self.obtained - self.expected) / self.scale

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance (a value that is not a number is not)."""
        return self.error <= self.tolerance


def worst_point(
    name: str, source: str, expected: Any, obtained: Any, tolerance: float, unit: str
) -> Case:
    """Case at the point of arrays (any shape) where they differ most.

    The tolerance is relative to the largest expected value.
    """
    e, o = np.broadcast_arrays(np.asarray(expected), np.asarray(obtained))
    at = np.unravel_index(int(np.argmax(np.abs(o - e))), e.shape)
    scale = float(np.max(np.abs(e)))
    return Case(name, source, complex(e[at]), complex(o[at]), tolerance, unit, scale)


def worst_ratio(
    name: str, source: str, expected: Any, obtained: Any, tolerance: float, unit: str
) -> Case:
    """Case at the point of arrays where they differ most relative to the value expected there."""
    e, o = np.broadcast_arrays(np.asarray(expected), np.asarray(obtained))
    at = np.unravel_index(int(np.argmax(np.abs(o / e - 1.0))), e.shape)
    return Case(name, source, complex(e[at]), complex(o[at]), tolerance, unit, float(abs(e[at])))
