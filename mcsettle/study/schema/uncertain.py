"""``[[uncertain]]`` and ``[[correlations]]``: inputs that are distributions."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.distributions import Distribution, distribution
from mcsettle.study.schema.base import KeyPath, Positive, Table, Text


class UncertainTable(Table):
    """``[[uncertain]]``: one input as a distribution, in the unit of its key."""

    input: KeyPath
    also: Annotated[tuple[KeyPath, ...], Field(max_length=20)] = ()
    distribution: Literal[
        "normal", "lognormal", "uniform", "log_uniform", "triangular", "pert", "beta", "discrete"
    ]
    mean: float | None = None
    sd: Positive | None = None
    median: float | None = None
    cov: Positive | None = None
    log_sd: Positive | None = None
    low: float | None = None
    mode: float | None = None
    high: float | None = None
    alpha: Positive | None = None
    beta: Positive | None = None
    values: Annotated[tuple[float, ...], Field(min_length=1, max_length=1000)] | None = None
    weights: Annotated[tuple[Positive, ...], Field(max_length=1000)] | None = None
    at_least: float | None = None
    at_most: float | None = None
    fitted: bool = False
    source: Text = ""

    @property
    def paths(self) -> tuple[str, ...]:
        """Key paths that take the value drawn."""
        return (self.input, *self.also)

    def built(self) -> Distribution:
        """The distribution.

        Raises
        ------
        InputError
            Parameters missing, not of this kind, or impossible.
        """
        others = {"input", "also", "distribution", "at_least", "at_most", "fitted", "source"}
        parameters = self.model_dump(exclude=others)
        return distribution(self.distribution, parameters, self.at_least, self.at_most)


class CorrelationTable(Table):
    """``[[correlations]]``: rank (Spearman) correlation of two uncertain inputs."""

    inputs: tuple[KeyPath, KeyPath]
    rank: Annotated[float, Field(gt=-1, lt=1)]
    source: Text = ""
