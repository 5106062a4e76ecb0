"""``[[uncertain]]`` and ``[[correlations]]`` of a study: inputs that are distributions, and checks.

An entry names an input by its key path and gives it a distribution; the value that the study itself
gives to that input is the central one. Everything is checked against the same schema as the study:
both ends of every distribution must be values the study would accept.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from mcsettle.errors import InputError
from mcsettle.study.distributions import Distribution, distribution
from mcsettle.study.faults import Fault, dotted, shown, suggestion
from mcsettle.study.key_paths import is_number, number_paths, replaced, steps_to, value_at
from mcsettle.study.schema import Positive, Table, Text

Path = Annotated[str, Field(min_length=1, max_length=200)]
ROOTS = ("track", "profile", "settlement", "limit", "economics", "trains", "scenarios", "variants")
# What fixes which tracks there are, or how long they are followed, is the same in every set.
FIXED = ("profile.window_m", "profile.shortest_m", "profile.longest_m", "limit.horizon_years")
FACTOR = "settlement_factor"
LEAST_EIGENVALUE = 1e-9


class UncertainTable(Table):
    """``[[uncertain]]``: one input as a distribution, in the unit of its key."""

    input: Path
    also: Annotated[tuple[Path, ...], Field(max_length=20)] = ()
    distribution: Literal[
        "normal",
        "lognormal",
        "uniform",
        "log_uniform",
        "triangular",
        "pert",
        "beta",
        "discrete",
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

    inputs: tuple[Path, Path]
    rank: Annotated[float, Field(gt=-1, lt=1)]
    source: Text = ""


def normal_scores_correlation(
    names: Sequence[str], correlations: Sequence[CorrelationTable]
) -> np.ndarray:
    """Correlation [D, D] of the normal scores that gives the rank correlations (Gaussian copula).

    A rank correlation ρ of normal variables belongs to a correlation 2 sin(πρ/6).

    Raises
    ------
    InputError
        The matrix is not positive definite.
    """
    matrix = np.eye(len(names))
    for entry in correlations:
        i, j = (names.index(name) for name in entry.inputs)
        matrix[i, j] = matrix[j, i] = 2.0 * np.sin(np.pi * entry.rank / 6.0)
    lowest = float(np.linalg.eigvalsh(matrix)[0]) if len(names) else 1.0
    if lowest < LEAST_EIGENVALUE:
        raise InputError(
            f"these correlations cannot hold together (not positive definite: lowest eigenvalue "
            f"{lowest:.3g}); bring them nearer to 0 or correct their signs"
        )
    return matrix


def with_values(data: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, Any]:
    """Study data with the inputs at the key paths ``values`` replaced: nothing uncertain, or observed.

    A whole number stays one where the study has one.
    """
    result: Any = {
        k: v for k, v in data.items() if k not in ("uncertain", "correlations", "observed")
    }
    result["run"] = {k: v for k, v in data.get("run", {}).items() if k != "parameter_sets"}
    for path, value in values.items():
        steps = steps_to(result, path)
        assert steps is not None, path
        whole = isinstance(value_at(result, steps), int) and float(value).is_integer()
        result = replaced(result, steps, int(value) if whole else float(value))
    return dict(result)


def uncertain_faults(
    data: Mapping[str, Any],
    entries: Sequence[UncertainTable],
    correlations: Sequence[CorrelationTable],
    accept: Callable[[Mapping[str, Any]], object],
    observed: bool = False,
) -> list[Fault]:
    """Faults of the uncertain inputs of a study that is sound without them.

    ``data`` is the study's mapping; ``accept`` builds a study of such a mapping or refuses it;
    ``observed``: whether it has observations.
    """
    faults = [f for place, entry in enumerate(entries) for f in _entry(data, place, entry)]
    faults += _fitted(data, entries, correlations, observed)
    faults += _twice(entries)
    faults += _correlations(entries, correlations)
    if not faults:
        faults = [
            f for place, entry in enumerate(entries) for f in _ends(data, place, entry, accept)
        ]
    return faults


def _entry(data: Mapping[str, Any], place: int, entry: UncertainTable) -> Iterator[Fault]:
    path = dotted(("uncertain", place))
    for name in entry.paths:
        steps = steps_to(data, name)
        if name in FIXED or steps is None or steps[0] not in ROOTS:
            can = [p for p in number_paths({k: data.get(k, {}) for k in ROOTS}) if p not in FIXED]
            if name in FIXED:
                said = "is the same in every parameter set and cannot be uncertain"
            elif name in can:
                said = "cannot be uncertain"
            else:
                near = suggestion(name, can) if len(can) < 8 else _near(name, can)
                said = f"is no input with a value in this study; {near}"
            yield Fault(f"{path}.input", f"'{name}' {said}")
        elif not is_number(value_at(data, steps)):
            yield Fault(
                f"{path}.input", f"'{name}' is no number but {shown(value_at(data, steps))}"
            )
        elif _is_overridden(data, name):
            yield Fault(
                f"{path}.input",
                f"every variant has its own value of '{name}'; name variants.<name>.… instead",
            )
    try:
        entry.built()
    except InputError as error:
        yield Fault(path, str(error))


def followers(variants: Sequence[Any], path: str) -> list[str]:
    """Names of the variants whose settlement factor is that at the key path ``path``."""
    if path == f"settlement.{FACTOR}":
        return [v.name for v in variants if getattr(v, FACTOR) is None]
    return [v.name for v in variants if path == f"variants.{v.name}.{FACTOR}"]


def _fitted(
    data: Mapping[str, Any],
    entries: Sequence[UncertainTable],
    correlations: Sequence[CorrelationTable],
    observed: bool,
) -> Iterator[Fault]:
    """Faults of inputs that every parameter set is to fit to the observations."""
    joined = {name for table in correlations for name in table.inputs}
    for place, entry in enumerate(entries):
        if not entry.fitted:
            continue
        path = f"{dotted(('uncertain', place))}.fitted"
        if not entry.input.endswith(f".{FACTOR}") or entry.also:
            yield Fault(path, f"only a {FACTOR} can be fitted, and alone; '{entry.input}' cannot")
        elif entry.distribution == "discrete" or entry.input in joined:
            yield Fault(path, "a fitted factor needs a continuous distribution and no correlations")
        elif not observed:
            yield Fault(path, "there is nothing to fit it to: give [[observed]] entries")
        elif entry.input == f"settlement.{FACTOR}" and _n_following(data) > 1:
            yield Fault(
                path,
                "several variants follow settlement.settlement_factor; give each its own and fit "
                "variants.<name>.settlement_factor",
            )


def _n_following(data: Mapping[str, Any]) -> int:
    return sum(FACTOR not in variant for variant in data.get("variants", ()))


def _near(name: str, can: Sequence[str]) -> str:
    text = suggestion(name, can)
    last = name.rsplit(".", 1)[-1]
    alike = [path for path in can if path.endswith(f".{last}")][:3]
    if text.startswith("did you mean"):
        return text
    return f"did you mean '{alike[0]}'?" if alike else "give the input a central value first"


def _is_overridden(data: Mapping[str, Any], name: str) -> bool:
    """Whether ``name`` is a settlement key that no variant takes from ``[settlement]``."""
    root, _, key = name.partition(".")
    variants = data.get("variants", ())
    return root == "settlement" and bool(variants) and all(key in v for v in variants)


def _twice(entries: Sequence[UncertainTable]) -> Iterator[Fault]:
    seen: set[str] = set()
    for place, entry in enumerate(entries):
        for name in entry.paths:
            if name in seen:
                path = f"{dotted(('uncertain', place))}.input"
                yield Fault(path, f"'{name}' is uncertain more than once")
            seen.add(name)


def _correlations(
    entries: Sequence[UncertainTable], correlations: Sequence[CorrelationTable]
) -> Iterator[Fault]:
    names = [entry.input for entry in entries]
    pairs: set[frozenset[str]] = set()
    sound = True
    for place, table in enumerate(correlations):
        path = dotted(("correlations", place, "inputs"))
        for name in table.inputs:
            if name not in names:
                sound = False
                yield Fault(path, f"'{name}' is no uncertain input; {suggestion(name, names)}")
        pair = frozenset(table.inputs)
        if len(pair) == 1 or pair in pairs:
            sound = False
            yield Fault(path, f"received {shown(list(table.inputs))}: two inputs, each pair once")
        pairs.add(pair)
    if sound:
        try:
            normal_scores_correlation(names, correlations)
        except InputError as error:
            yield Fault("correlations", str(error))


def _ends(
    data: Mapping[str, Any],
    place: int,
    entry: UncertainTable,
    accept: Callable[[Mapping[str, Any]], object],
) -> Iterator[Fault]:
    """Both ends of a distribution, tried as the value of its inputs, the others central."""
    built = entry.built()
    values = entry.values if entry.values is not None else built.ends
    for value in values:
        try:
            accept(with_values(data, dict.fromkeys(entry.paths, float(value))))
        except InputError as error:
            reason = " ".join(line.strip() for line in str(error).splitlines()[1:])
            yield Fault(
                dotted(("uncertain", place)),
                f"its range reaches {value:.6g}, which the study refuses ({reason}); choose another "
                "distribution, or cut this one with at_least and at_most",
            )
            return
