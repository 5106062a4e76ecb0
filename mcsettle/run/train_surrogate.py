"""Learn a surrogate of Step A over the parameter sets of a study, until its errors are within tolerance.

Everything follows from the study and its seed: the sets to learn from are chosen among the first draws,
however many are run, and their Step A lies in the cache folder like any other, so that a run that is
resumed, or another process, learns the same without computing it again.
"""

import json
from collections.abc import Sequence
from concurrent.futures import as_completed
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from mcsettle.errors import InputError, NumericalError
from mcsettle.railway.scene import Scene
from mcsettle.railway.traffic import Service, Timetable
from mcsettle.run.code_digest import code_digest
from mcsettle.run.left_out import LeftOut, errors_per_deviation, left_out, quantiles
from mcsettle.run.surrogate import Expected, GroundPredictor, Passage, Training, list_passages
from mcsettle.step_a.fem25d.cache import digest_of, read_arrays, write_arrays
from mcsettle.step_a.kriging import next_spread
from mcsettle.step_a.processes import process_pool
from mcsettle.step_a.surrogate import Inputs, Surrogate, inputs_of, learnt, relearnt
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_a.transfers import Ground, TransferStore, into_cache, step_a
from mcsettle.storage.files import cache_folder
from mcsettle.study.candidates import Candidates
from mcsettle.types import Progress, silent

FIRST = 3  # sets that are computed before errors are estimated, and as many more for each input
STEP = 2  # further sets at a time
COMPLETE = 6  # every sixth draw is computed at all speeds, the others at the lowest and highest
FEWEST = 3  # sets to learn from
OUTSIDE = 0.01  # share of the sets that may be beyond the tolerance at the end


@dataclass(eq=False)
class _Learning:
    """State of a training: candidates, what is computed of them, in the order chosen.

    ``refused``: sets that cannot be computed.
    """

    store: TransferStore
    baseline: str
    indices: list[int]
    scenes: list[tuple[Scene, ...]]
    passages: list[list[Passage]]
    inputs: dict[str, Inputs]
    places: np.ndarray
    chosen: list[int] = field(default_factory=list)
    refused: list[int] = field(default_factory=list)
    transfers: dict[Any, TransferFunctions] = field(default_factory=dict)

    @property
    def n_grounds(self) -> int:
        """Grounds computed so far, those of each set counted."""
        of_sets = (_by_ground(self.passages[c], c % COMPLETE == 0) for c in self.chosen)
        return sum(map(len, of_sets))


def set_predictor(
    candidates: Candidates, store: TransferStore, processes: int = 1, progress: Progress = silent
) -> Training | None:
    """Give ``store`` a predictor of the Step A of parameter sets; returns what it has learnt from.

    None, and no predictor, where all ``candidates`` have the same. ``processes`` are spawned for the
    grounds to learn from.
    """
    state = _begun(candidates, store.emptied())
    if state.places.shape[1] == 0:
        return None
    table = candidates.table
    tolerance = Expected(table.tolerance_percent, table.tolerance_points)
    digest = digest_of({"study": candidates.digest, "code": code_digest()})
    path = cache_folder() / f"surrogate-{digest[:32]}.npz"
    stored = read_arrays(path, "training of a surrogate", lambda arrays: str(arrays["training"]))
    if stored is None:
        predictor = _trained(state, table.most_grounds, tolerance, processes, progress)
        write_arrays(path, {"training": np.array(_stored(state, predictor))})
    else:
        predictor = _restored(state, json.loads(stored), tolerance, processes, progress)
    store.predictor = predictor
    return predictor.training


def _trained(
    state: _Learning, most_grounds: int, tolerance: Expected, processes: int, progress: Progress
) -> GroundPredictor:
    """Compute sets until the tolerance is met, or as many grounds as may be."""
    n_first = FIRST * (1 + state.places.shape[1])
    first = [0, *next_spread(state.places, [0], n_first - 1)]
    affordable = _affordable(state, first, most_grounds)
    _compute(state, first[: max(len(affordable), FEWEST)], processes, progress)
    while True:
        predictor, worst = _learnt(state, tolerance)
        further = _affordable(state, worst[:STEP], most_grounds - state.n_grounds)
        if predictor.training.met or not further:
            return predictor
        _compute(state, further, processes, progress)


def _affordable(state: _Learning, sets: Sequence[int], most_grounds: int) -> list[int]:
    """The first ones of ``sets`` that take no more than ``most_grounds`` together."""
    grounds = [len(_by_ground(state.passages[c], c % COMPLETE == 0)) for c in sets]
    return [c for c, total in zip(sets, np.cumsum(grounds), strict=True) if total <= most_grounds]


def _stored(state: _Learning, predictor: GroundPredictor) -> str:
    """A finished training as text; its transfer functions lie in the cache folder themselves."""
    learnt_of_kind = {
        kind: {"lengths": s.kriging.lengths.tolist(), "terms": s.kriging.terms}
        for kind, s in predictor.surrogates.items()
    }
    return json.dumps(
        {
            "chosen": state.chosen,
            "surrogates": learnt_of_kind,
            "per_deviation": predictor.per_deviation,
            "training": asdict(predictor.training),
        }
    )


def _restored(
    state: _Learning,
    stored: dict[str, Any],
    tolerance: Expected,
    processes: int,
    progress: Progress,
) -> GroundPredictor:
    """Predictor of a training that was finished before."""
    _compute(state, stored["chosen"], processes, progress)
    members, surrogates = _members(state), {}
    for kind, inputs in state.inputs.items():
        points, transfers = _of_kind(state, members[kind])
        of_kind = stored["surrogates"][kind]
        terms = tuple(tuple(term) for term in of_kind["terms"])
        surrogates[kind] = relearnt(inputs, points, transfers, np.array(of_kind["lengths"]), terms)
    training = stored["training"]
    return GroundPredictor(
        state.store,
        surrogates,
        set(state.transfers),
        Expected(*stored["per_deviation"]),
        tolerance,
        Training(**(training | {"sets": tuple(training["sets"])})),
    )


def _begun(candidates: Candidates, store: TransferStore) -> _Learning:
    """What varies among the candidates that differ from the first in numbers alone."""
    indices, scenes = list(candidates.indices), list(candidates.scenes)
    passages = [list_passages(of_set, store) for of_set in scenes]
    kinds = [tuple(p.description.kind for p in of_set) for of_set in passages]
    alike = [i for i, kind in enumerate(kinds) if kind == kinds[0]]
    indices, scenes = [indices[i] for i in alike], [scenes[i] for i in alike]
    passages = [passages[i] for i in alike]
    by_kind: dict[str, list[np.ndarray]] = {}
    for of_set in passages:
        for passage in of_set:
            by_kind.setdefault(passage.description.kind, []).append(passage.description.numbers)
    inputs = {kind: inputs_of(np.stack(numbers)) for kind, numbers in by_kind.items()}
    places = _places(passages, inputs)
    return _Learning(store, candidates.baseline, indices, scenes, passages, inputs, places)


def _places(passages: list[list[Passage]], inputs: dict[str, Inputs]) -> np.ndarray:
    """Sets as points [S, D] of all that varies between them: speeds that all have in common do not."""
    rows = [np.concatenate([_point(p, inputs) for p in of_set]) for of_set in passages]
    # Points are standard deviations already, of either sign: taken as they are.
    return np.stack(rows)[:, inputs_of(np.stack(rows)).columns]


def _point(passage: Passage, inputs: dict[str, Inputs]) -> np.ndarray:
    point = inputs[passage.description.kind].point(passage.description.numbers)
    assert point is not None
    return point


def _compute(state: _Learning, sets: Sequence[int], processes: int, progress: Progress) -> None:
    """Step A of further ``sets``, in processes where there are several; into ``state``."""
    jobs = [(c, _by_ground(state.passages[c], c % COMPLETE == 0)) for c in sets]
    if processes > 1:
        with process_pool(processes) as pool:
            running = [
                pool.submit(
                    into_cache, _learnt_from(state.passages[c]), state.store.emptied(), keys
                )
                for c, by_ground in jobs
                for keys in by_ground
            ]
            for done, finished in enumerate(as_completed(running), 1):
                with suppress(InputError, NumericalError):
                    finished.result()
                progress("Step A: grounds to learn from", done, len(running))
    for done, (candidate, by_ground) in enumerate(jobs, 1):
        store = state.store.emptied()
        scenes, keys = _learnt_from(state.passages[candidate]), set[Any]().union(*by_ground)
        try:
            step_a(scenes, progress, 1, store, only=keys)
        except (InputError, NumericalError):  # where it is run, the run says so
            state.refused.append(candidate)
            continue
        state.chosen.append(candidate)
        state.transfers |= {key: store.transfers[key] for key in keys}
        progress("Step A: grounds to learn from", done, len(jobs))


def _learnt_from(passages: list[Passage]) -> tuple[Scene, ...]:
    """Scenes of a set, its trains under the loads of the study where loads only scale."""
    services: dict[Scene, tuple[Service, ...]] = {}
    for p in passages:
        services[p.scene] = (*services.get(p.scene, ()), p.service)
    return tuple(
        replace(scene, timetable=Timetable(of_scene)) for scene, of_scene in services.items()
    )


def _by_ground(passages: list[Passage], complete: bool) -> list[set[Any]]:
    """Passages of a set to compute, those of one ground together.

    On linear ground all; on ground that softens, unless ``complete``, the speeds at the ends of a kind.
    """
    keys: dict[Ground, set[Any]] = {}
    speeds: dict[str, list[float]] = {}
    for passage in passages:
        speeds.setdefault(passage.description.kind, []).append(passage.service.speed)
    for passage in passages:
        ends = min(speeds[passage.description.kind]), max(speeds[passage.description.kind])
        if complete or passage.ground.softened is None or passage.service.speed in ends:
            keys.setdefault(passage.ground, set()).add(passage.key)
    return list(keys.values())


def _learnt(state: _Learning, tolerance: Expected) -> tuple[GroundPredictor, list[int]]:
    """Predictor from what is computed, and the sets that it predicts worst, worst first."""
    members = _members(state)
    surrogates = {}
    for kind, inputs in state.inputs.items():
        rows = members[kind]
        groups = [np.flatnonzero([c == candidate for c, _ in rows]) for candidate in state.chosen]
        points, transfers = _of_kind(state, rows)
        surrogates[kind] = learnt(inputs, points, transfers, groups)
    errors = [_left_out(state, surrogates, members, candidate) for candidate in state.chosen]
    shares = _shares(state.places, state.chosen)
    per_deviation = Expected(*errors_per_deviation(errors, shares))
    deviations = np.array([_deviation(state, surrogates, p) for p in state.passages])
    expected = np.outer(deviations, per_deviation) / np.array(tolerance)
    beyond = np.max(expected, axis=1)
    beyond[state.chosen] = 0.0
    worst_errors = quantiles(errors, shares)
    met = (
        worst_errors.days_p95 <= tolerance.percent
        and worst_errors.points_p95 <= tolerance.points
        and float(np.mean(beyond > 1.0)) <= OUTSIDE
    )
    order = np.argsort(-beyond, kind="stable")
    worst = [int(i) for i in order if i not in state.chosen and i not in state.refused]
    predictor = GroundPredictor(
        state.store,
        surrogates,
        set(state.transfers),
        per_deviation,
        tolerance,
        Training(
            tuple(state.indices[c] for c in state.chosen),
            state.n_grounds,
            worst_errors.days_median,
            worst_errors.days_p95,
            worst_errors.points_p95,
            met,
            digest_of({kind: surrogate.digest for kind, surrogate in surrogates.items()}),
        ),
    )
    return predictor, worst


def _of_kind(
    state: _Learning, rows: list[tuple[int, Passage]]
) -> tuple[np.ndarray, list[TransferFunctions]]:
    """Points [N, D] and transfer functions of computed passages."""
    points = np.stack([_point(p, state.inputs) for _, p in rows])
    return points, [state.transfers[p.key] for _, p in rows]


def _members(state: _Learning) -> dict[str, list[tuple[int, Passage]]]:
    """Computed passages of every kind, each key of a set once."""
    members: dict[str, list[tuple[int, Passage]]] = {kind: [] for kind in state.inputs}
    for candidate in state.chosen:
        different = {p.key: p for p in state.passages[candidate] if p.key in state.transfers}
        for passage in different.values():
            members[passage.description.kind].append((candidate, passage))
    return members


def _left_out(
    state: _Learning,
    surrogates: dict[str, Surrogate],
    members: dict[str, list[tuple[int, Passage]]],
    candidate: int,
) -> LeftOut:
    """Errors of a training set that is predicted from the others."""
    exact, predicted, deviation = {}, {}, 0.0
    for kind, surrogate in surrogates.items():
        group = np.flatnonzero([c == candidate for c, _ in members[kind]])
        weights, deviations = surrogate.kriging.left_out(group)
        deviation = max(deviation, float(np.max(deviations, initial=0.0)))
        for row, place in zip(weights, group, strict=True):
            passage = members[kind][place][1]
            exact[passage.key] = surrogate.training[place]
            predicted[passage.key] = surrogate.combined(
                row, passage.scene, passage.service, passage.ground.track, ""
            )
    return left_out(
        state.scenes[candidate],
        _by_scene(state.passages[candidate], exact),
        _by_scene(state.passages[candidate], predicted),
        deviation,
        state.baseline,
    )


def _by_scene(
    passages: list[Passage], transfers: dict[Any, TransferFunctions]
) -> dict[tuple[str, str], tuple[TransferFunctions, ...]]:
    """Transfer functions of those scenes all of whose services have some."""
    scenes: dict[tuple[str, str], list[TransferFunctions | None]] = {}
    for p in passages:
        scenes.setdefault((p.scene.variant, p.scene.scenario), []).append(transfers.get(p.key))
    return {
        pair: tuple(t for t in group if t is not None)
        for pair, group in scenes.items()
        if None not in group
    }


def _deviation(
    state: _Learning, surrogates: dict[str, Surrogate], passages: list[Passage]
) -> float:
    """Largest standard deviation of the passages of a set."""
    different = {p.key: p for p in passages}.values()
    return max(
        float(surrogates[p.description.kind].kriging.deviations(_point(p, state.inputs)[None])[0])
        for p in different
    )


def _shares(places: np.ndarray, chosen: list[int]) -> np.ndarray:
    """Share [N] of all sets that is nearest to each of the sets ``chosen``."""
    apart = np.sum((places[:, None, :] - places[None, chosen, :]) ** 2, axis=-1)
    counts = np.bincount(np.argmin(apart, axis=1), minlength=len(chosen))
    return np.asarray(counts / len(places))
