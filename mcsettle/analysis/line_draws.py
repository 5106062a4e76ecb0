"""Ways a line may go: forms of growth, rates and starts as its runs left them, drawn for all sections."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mcsettle.analysis.line_forecast import LineForecast

_STREAM = 0x11E  # of the seed


@dataclass(frozen=True, eq=False)
class LineDraw:
    """Number of a ``form`` of growth; numbers [S] of each section's ``start`` SD and ``rate``."""

    form: int
    start: np.ndarray
    rate: np.ndarray


def line_draws(forecast: LineForecast, count: int, seed: int) -> Iterator[LineDraw]:
    """So many draws of the whole line.

    Sections are drawn together: each draw has one form of growth and one pair (μ, τ) of the line, and
    every section its rate and start SD given these.
    """
    rng = np.random.default_rng([seed, _STREAM])
    carried = [f for f in range(len(forecast.forms)) if (forecast.form_of_rate == f).any()]
    probability = np.array([forecast.forms[f].probability for f in carried])
    of_rate = forecast.weights.sum(axis=1, keepdims=True)
    start_given_rate = forecast.weights / np.maximum(of_rate, 1e-300)
    rows = np.arange(len(forecast.rows))
    for form in rng.choice(carried, count, p=probability / probability.sum()):
        pooled = forecast.forms[form].pooled
        pair = rng.choice(len(pooled.hyper), p=pooled.hyper)
        rate = _drawn(pooled.likelihood * pooled.given[pair], rng)
        rate += int(np.argmax(forecast.form_of_rate == form))
        yield LineDraw(int(form), _drawn(start_given_rate[rows, :, rate], rng), rate)


def _drawn(weights: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """One index [S] for each row of ``weights`` [S, W], in proportion to them."""
    below = np.cumsum(weights, axis=1)
    at = np.sum(rng.random((len(weights), 1)) * below[:, -1:] > below, axis=1)
    return np.minimum(at, weights.shape[1] - 1)
