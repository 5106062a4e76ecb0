"""Inputs that are distributions: each has a value in the study, and its whole range is accepted."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from mcsettle.errors import InputError
from mcsettle.study.faults import Fault, dotted, shown, suggestion
from mcsettle.study.key_paths import is_number, number_paths, steps_to, value_at
from mcsettle.study.schema.study import StudyTables
from mcsettle.study.schema.uncertain import CorrelationTable, UncertainTable
from mcsettle.study.uncertain import FACTOR, normal_scores_correlation, with_values

ROOTS = (
    *("track", "profile", "settlement", "spatial_variability", "limit", "economics"),
    *("trains", "scenarios", "variants"),
)
# What fixes which tracks there are, or how long they are followed, is the same in every set.
FIXED = ("profile.window_m", "profile.shortest_m", "profile.longest_m", "limit.horizon_years")


def uncertain_faults(
    study: StudyTables, data: Mapping[str, Any], accept: Callable[[Mapping[str, Any]], object]
) -> list[Fault]:
    """Faults of the uncertain inputs of a study that is valid without them.

    ``data`` is the study's mapping; ``accept`` builds a study of such a mapping or refuses it.
    """
    entries, correlations = study.uncertain, study.correlations
    if study.grounds_table is not None:
        said = "cannot stand beside [[uncertain]] inputs"
        return [Fault("grounds", said)] if entries else []
    if not entries:
        useless = "correlations" if correlations else "run.parameter_sets"
        said = "has no meaning without [[uncertain]] inputs; leave it out"
        given = bool(correlations) or (study.run.parameter_sets or 1) > 1
        return [Fault(useless, said)] if given else []
    faults = [f for place, entry in enumerate(entries) for f in _entry(data, place, entry)]
    faults += _fitted(data, entries, correlations, bool(study.observed))
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


def _fitted(
    data: Mapping[str, Any],
    entries: Sequence[UncertainTable],
    correlations: Sequence[CorrelationTable],
    observed: bool,
) -> Iterator[Fault]:
    """Faults of inputs that every parameter set is to fit to the observations."""
    joined = {name for table in correlations for name in table.inputs}
    n_following = sum(FACTOR not in variant for variant in data.get("variants", ()))
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
        elif entry.input == f"settlement.{FACTOR}" and n_following > 1:
            yield Fault(
                path,
                "several variants follow settlement.settlement_factor; give each its own and fit "
                "variants.<name>.settlement_factor",
            )


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
