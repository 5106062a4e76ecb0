"""Distributions of uncertain inputs: quantile functions from a few plain parameters.

Every kind is a SciPy distribution; what is here is the choice of parameters an engineer can state
(a median and a coefficient of variation, three points of an opinion) and truncation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcsettle.errors import InputError

TAIL = 1e-6  # share of an unbounded distribution on each side that is not asked about
PERT_WEIGHT = 4.0  # of the mode, as usual
KINDS: Mapping[str, tuple[str, ...]] = {
    "normal": ("mean", "sd"),
    "lognormal": ("median",),  # and cov or log_sd
    "uniform": ("low", "high"),
    "log_uniform": ("low", "high"),
    "triangular": ("low", "mode", "high"),
    "pert": ("low", "mode", "high"),
    "beta": ("low", "high", "alpha", "beta"),
    "discrete": ("values",),
}


@dataclass(frozen=True)
class Distribution:
    """A distribution cut to the cumulative probabilities ``from_`` … ``to``.

    ``frozen`` has SciPy's ``ppf`` and ``cdf``; ``endless`` if its own ends are never drawn.
    """

    frozen: Any
    from_: float = 0.0
    to: float = 1.0
    endless: bool = False

    def quantile(self, probability: np.ndarray | float) -> np.ndarray:
        """Values at ``probability`` of the cut distribution, any shape."""
        share = self.from_ + np.asarray(probability, dtype=float) * (self.to - self.from_)
        return np.asarray(self.frozen.ppf(share), dtype=float)

    def share_below(self, value: np.ndarray | float) -> np.ndarray:
        """Cumulative probability of the cut distribution at ``value``, any shape."""
        with np.errstate(over="ignore"):  # no number of standard deviations is too large
            share = np.asarray(self.frozen.cdf(value), dtype=float)
        return np.asarray(np.clip((share - self.from_) / (self.to - self.from_), 0.0, 1.0))

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value; of an endless side, the quantile at ``TAIL`` from its end."""
        low = TAIL if self.endless and self.from_ == 0.0 else 0.0
        high = 1.0 - TAIL if self.endless and self.to == 1.0 else 1.0
        return float(self.quantile(low)), float(self.quantile(high))


@dataclass(frozen=True)
class _Discrete:
    """Values [n] rising, with cumulative probabilities [n]."""

    values: np.ndarray
    cumulative: np.ndarray

    def ppf(self, share: np.ndarray) -> np.ndarray:
        # Rounding of the sum must not push the last value out of reach.
        index = np.searchsorted(self.cumulative * (1.0 - 1e-12), share, side="left")
        return np.asarray(self.values[np.minimum(index, len(self.values) - 1)])

    def cdf(self, value: np.ndarray | float) -> np.ndarray:
        reached = np.append(0.0, self.cumulative)
        return np.asarray(reached[np.searchsorted(self.values, value, side="right")])


@dataclass(frozen=True)
class _LogUniform:
    """Uniform in the logarithm; SciPy's own rounds its ends outwards."""

    low: float
    high: float

    def ppf(self, share: np.ndarray) -> np.ndarray:
        between = self.low * (self.high / self.low) ** share
        return np.asarray(np.clip(between, self.low, self.high))

    def cdf(self, value: np.ndarray | float) -> np.ndarray:
        inside = np.clip(value, self.low, self.high)
        return np.asarray(np.log(inside / self.low) / np.log(self.high / self.low))


def distribution(
    kind: str,
    parameters: Mapping[str, float | Sequence[float] | None],
    at_least: float | None = None,
    at_most: float | None = None,
) -> Distribution:
    """The distribution ``kind`` (a key of ``KINDS``), cut to ``at_least`` … ``at_most``.

    Parameters
    ----------
    kind : str
    parameters : mapping
        normal: mean, sd. lognormal: median and either cov (sd over mean) or log_sd. uniform,
        log_uniform: low, high. triangular, pert: low, mode, high. beta: alpha, beta and the range
        low, high. discrete: values and optionally weights.
    at_least, at_most : float, optional

    Raises
    ------
    InputError
        Parameters missing, not of this kind, or impossible; truncation that leaves nothing.
    """
    given = {key: value for key, value in parameters.items() if value is not None}
    _check_names(kind, given)
    frozen = _frozen(kind, given)
    endless = kind in ("normal", "lognormal")
    if at_least is None and at_most is None:
        return Distribution(frozen, endless=endless)
    if kind == "discrete":
        raise InputError("a discrete distribution is not truncated: leave the values out")
    complete = Distribution(frozen)
    low = 0.0 if at_least is None else float(complete.share_below(at_least))
    high = 1.0 if at_most is None else float(complete.share_below(at_most))
    if not high - low > TAIL:
        bounds = f"at_least = {at_least}, at_most = {at_most}"
        raise InputError(f"truncation ({bounds}) leaves {max(high - low, 0.0):.2g} of it")
    return Distribution(frozen, low, high, endless)


def _check_names(kind: str, given: Mapping[str, Any]) -> None:
    optional = {"lognormal": {"cov", "log_sd"}, "discrete": {"weights"}}.get(kind, set())
    wanted = set(KINDS[kind])
    missing, odd = sorted(wanted - set(given)), sorted(set(given) - wanted - optional)
    if kind == "lognormal" and not missing and len(set(given) & optional) != 1:
        missing = ["cov or log_sd (one of them)"]
    if missing or odd:
        parts = [f"it needs {', '.join(missing)}"] if missing else []
        parts += [f"{', '.join(odd)} has no meaning here"] if odd else []
        raise InputError(f"{kind}: {'; '.join(parts)}")


def _positive(kind: str, given: Mapping[str, Any], *names: str) -> list[float]:
    for name in names:
        if not given[name] > 0.0:
            raise InputError(f"{kind}: {name} is {given[name]:g}; it must be positive")
    return [float(given[name]) for name in names]


def _check_felt(kind: str, name: str, spread: float, centre: float) -> None:
    if centre + spread == centre:
        raise InputError(
            f"{kind}: {name} is {spread:g}, which rounding loses beside {centre:g}; leave the input "
            "out of [[uncertain]], or give it a spread"
        )


def _range(kind: str, given: Mapping[str, Any]) -> tuple[float, float]:
    low, high = float(given["low"]), float(given["high"])
    if not low < high:
        raise InputError(f"{kind}: low = {low:g} and high = {high:g}; low must be below high")
    return low, high


def _frozen(kind: str, given: Mapping[str, Any]) -> Any:
    """The whole distribution, with its ``ppf`` and ``cdf``."""
    from scipy import stats  # takes longer to import than all the rest

    match kind:
        case "normal":
            (sd,) = _positive(kind, given, "sd")
            _check_felt(kind, "sd", sd, float(given["mean"]))
            return stats.norm(given["mean"], sd)
        case "lognormal":
            name = "cov" if "cov" in given else "log_sd"
            median, spread = _positive(kind, given, "median", name)
            _check_felt(kind, name, spread, 1.0)
            log_sd = float(np.sqrt(np.log1p(spread**2))) if name == "cov" else spread
            return stats.lognorm(log_sd, scale=median)
        case "discrete":
            return _discrete(given)
        case "log_uniform":
            _positive(kind, given, "low")
            return _LogUniform(*_range(kind, given))
    low, high = _range(kind, given)
    if kind == "uniform":
        return stats.uniform(low, high - low)
    if kind == "beta":
        return stats.beta(*_positive(kind, given, "alpha", "beta"), low, high - low)
    mode = float(given["mode"])
    if not low <= mode <= high:
        raise InputError(f"{kind}: mode = {mode:g} lies outside {low:g} … {high:g}")
    share = (mode - low) / (high - low)
    if kind == "triangular":
        return stats.triang(share, low, high - low)
    shapes = 1.0 + PERT_WEIGHT * share, 1.0 + PERT_WEIGHT * (1.0 - share)
    return stats.beta(*shapes, low, high - low)


def _discrete(given: Mapping[str, Any]) -> _Discrete:
    values = np.asarray(given["values"], dtype=float)
    weights = np.asarray(given.get("weights", np.ones(len(values))), dtype=float)
    if len(values) == 0 or len(weights) != len(values):
        raise InputError(f"discrete: {len(values)} values with {len(weights)} weights")
    if np.any(weights <= 0.0) or len(np.unique(values)) != len(values):
        raise InputError("discrete: weights must be positive and values must differ")
    order = np.argsort(values)
    return _Discrete(values[order], np.cumsum(weights[order]) / np.sum(weights))
