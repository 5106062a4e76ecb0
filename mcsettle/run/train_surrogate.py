"""Learn a surrogate of Step A over the parameter sets of a study, until its errors are within tolerance.

Everything follows from the study and its seed: the sets to learn from are chosen among the first draws,
however many are run, and their Step A lies in the cache folder like any other, so that a run that is
resumed, or another process, learns the same without computing it again.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict
from itertools import count
from typing import Any

import numpy as np

from mcsettle.run.code_digest import code_digest
from mcsettle.run.left_out import errors_per_deviation, quantiles
from mcsettle.run.sets_left_out import sets_left_out
from mcsettle.run.surrogate import (
    Expected,
    GroundPredictor,
    Training,
    list_passages,
)
from mcsettle.run.surrogate_fit import (
    Family,
    Learned,
    Learning,
    families_of,
    fits_of,
    surrogates_of,
)
from mcsettle.run.training_grounds import (
    computed_on,
    learnt_on,
    scenes_learnt_from,
    training_grounds,
)
from mcsettle.step_a.fem25d.cache import digest_of, read_arrays, write_arrays
from mcsettle.step_a.kriging import conditioned, isotropic, most_telling
from mcsettle.step_a.processes import Together, together
from mcsettle.step_a.surrogate import Surrogate, inputs_of
from mcsettle.step_a.transfers import TransferStore
from mcsettle.storage.files import cache_folder
from mcsettle.study.candidates import Candidates
from mcsettle.types import Progress, silent

FIRST = 3  # sets that are computed before errors are estimated, and as many more for each input
STEP = 6  # further sets at a time, at least; a quarter of those that there are
BOTH = 3  # every third set has the grounds of the lowest speeds, too
FEWEST = 3  # sets to learn from
OUTSIDE = 0.002  # share of the sets that may be beyond the tolerance at the end


def set_predictor(
    candidates: Candidates, store: TransferStore, processes: int = 1, progress: Progress = silent
) -> Training | None:
    """Give ``store`` a predictor of the Step A of parameter sets; returns what it has learnt from.

    None, and no predictor, where all ``candidates`` have the same, or too few can be computed.
    ``processes`` are spawned for the grounds to learn from.
    """
    state = _begun(candidates, store.emptied())
    if state.places.shape[1] == 0:
        return None
    table = candidates.table
    tolerance = Expected(table.tolerance_percent, table.tolerance_points)
    digest = digest_of({"study": candidates.digest, "code": code_digest()})
    path = cache_folder() / f"surrogate-{digest[:32]}.npz"
    stored = read_arrays(path, "training of a surrogate", lambda arrays: str(arrays["training"]))
    with together(processes) as several:
        if stored is None:
            trained = _trained(state, table.most_grounds, tolerance, several, progress)
            if trained is None:
                return None
            predictor, groups = trained
            write_arrays(path, {"training": np.array(_stored(state, predictor, groups))})
        else:
            predictor = _restored(state, json.loads(stored), tolerance, several, progress)
    store.predictor = predictor
    return predictor.training


def _trained(
    state: Learning, most_grounds: int, tolerance: Expected, processes: Together, progress: Progress
) -> tuple[GroundPredictor, list[Learned]] | None:
    """Compute sets until the tolerance is met, or as many grounds as may be."""
    n_first = FIRST * (1 + state.places.shape[1])
    first = [0, *most_telling(isotropic(state.places), [0], n_first - 1)]
    affordable = _affordable(state, first, most_grounds)
    _compute(state, _planned(state, first)[: max(len(affordable), FEWEST)], processes, progress)
    if len(state.chosen) < FEWEST:
        return None
    while True:
        groups = surrogates_of(state)
        predictor, worst = _assessed(state, groups, tolerance, processes)
        # A set beyond the tolerance takes less to learn from than to compute at every speed.
        n = max(STEP, len(state.chosen) // 4)
        further = worst[:n] if worst else _most_telling(state, groups, n)
        further = _affordable(state, further, most_grounds - state.n_grounds)
        if predictor.training.met or not further:
            return predictor, groups
        _compute(state, _planned(state, further), processes, progress)


def _most_telling(state: Learning, groups: Sequence[Learned], n: int) -> list[int]:
    """Next ``n`` sets to learn from: those that tell most of all."""
    unknown = [
        surrogate.levels[0].kriging.covariance(family.points) for (family, surrogate), *_ in groups
    ]
    tried = [*state.chosen, *state.refused]
    return most_telling(np.sum(unknown, axis=0), tried, n)


def _planned(state: Learning, sets: Sequence[int]) -> list[tuple[int, bool]]:
    """Further ``sets``, and whether they have the grounds of the lowest speeds, too."""
    begun = len(state.chosen) + len(state.refused)
    return [(c, i == 1 or i % BOTH == 0) for i, c in enumerate(sets, begun)]


def _affordable(state: Learning, sets: Sequence[int], most_grounds: int) -> list[int]:
    """The first ones of ``sets`` that take no more than ``most_grounds`` together."""
    totals = np.cumsum([state.grounds_of(*planned) for planned in _planned(state, sets)])
    return [c for c, total in zip(sets, totals, strict=True) if total <= most_grounds]


def _stored(state: Learning, predictor: GroundPredictor, groups: list[Learned]) -> str:
    """A finished training as text; its transfer functions lie in the cache folder themselves."""
    return json.dumps(
        {
            "chosen": state.chosen,
            "both": state.both,
            "fits": [
                [
                    (kriging.lengths.tolist(), kriging.terms, size)
                    for kriging, size in fits_of(group)
                ]
                for group in groups
            ],
            "per_deviation": predictor.per_deviation,
            "training": asdict(predictor.training),
        }
    )


def _restored(
    state: Learning,
    stored: dict[str, Any],
    tolerance: Expected,
    processes: Together,
    progress: Progress,
) -> GroundPredictor:
    """Predictor of a training that was finished before."""
    sets = [(c, c in stored["both"]) for c in stored["chosen"]]
    _compute(state, sets, processes, progress)
    fits = []
    for families, levels in zip(state.families, stored["fits"], strict=True):
        of_levels = zip((state.chosen, state.both), levels, strict=False)
        fits.append(
            [
                (conditioned(families[0].points[c], np.array(k), tuple(map(tuple, terms))), size)
                for c, (k, terms, size) in of_levels
            ]
        )
    training = stored["training"]
    return _predictor(
        state,
        [pair for group in surrogates_of(state, fits) for pair in group],
        Expected(*stored["per_deviation"]),
        tolerance,
        Training(**(training | {"sets": tuple(training["sets"])})),
    )


def _begun(candidates: Candidates, store: TransferStore) -> Learning:
    """What varies among the candidates that differ from the first in numbers alone."""
    indices, scenes = list(candidates.indices), list(candidates.scenes)
    passages = [list_passages(of_set, store) for of_set in scenes]
    kinds = [tuple(p.description.kind for p in of_set) for of_set in passages]
    alike = [i for i, kind in enumerate(kinds) if kind == kinds[0]]
    indices, scenes = [indices[i] for i in alike], [scenes[i] for i in alike]
    passages = [passages[i] for i in alike]
    families = families_of(passages)
    points = np.concatenate([group[0].points for group in families], axis=1)
    # Points are standard deviations already, of either sign: taken as they are.
    places = points[:, inputs_of(points).columns]
    return Learning(store, candidates.baseline, indices, scenes, passages, families, places)


def _compute(
    state: Learning, sets: Sequence[tuple[int, bool]], processes: Together, progress: Progress
) -> None:
    """Step A of further ``sets`` as ``_planned``."""
    grounds = [training_grounds(state.passages[c], both) for c, both in sets]
    jobs = [
        (ground, scenes_learnt_from(state.passages[c]), state.store)
        for (c, _), of_set in zip(sets, grounds, strict=True)
        for ground in of_set
    ]
    done = count(1)
    results = iter(
        processes.map(
            computed_on,
            jobs,
            lambda _: progress("Step A: grounds to learn from", next(done), len(jobs)),
        )
    )
    for (candidate, both), of_set in zip(sets, grounds, strict=True):
        on_grounds = [transfers for _, transfers in zip(of_set, results, strict=False)]
        learnt = learnt_on(of_set, on_grounds)
        if learnt is None:  # where it is run, the run says why
            state.refused.append(candidate)
            continue
        state.learnt[candidate] = learnt
        state.chosen.append(candidate)
        if both:
            state.both.append(candidate)


def _assessed(
    state: Learning, groups: Sequence[Learned], tolerance: Expected, processes: Together
) -> tuple[GroundPredictor, list[int]]:
    """Predictor from what is computed, with errors where each set is left out.

    Once most are within the tolerance, also the sets that are beyond, worst first.
    """
    surrogates = [pair for group in groups for pair in group]
    errors = sets_left_out(state, surrogates, processes)
    shares = _shares(state.places, state.chosen)
    per_deviation = Expected(*errors_per_deviation(errors, shares))
    deviations = np.max([s.deviations(family.points) for family, s in surrogates], axis=0)
    beyond = np.max(np.outer(deviations, per_deviation) / np.array(tolerance), axis=1)
    beyond[[*state.chosen, *state.refused]] = 0.0
    worst = [int(i) for i in np.argsort(-beyond, kind="stable") if beyond[i] > 1.0]
    of_all = quantiles(errors, shares)
    most_are = of_all.days_p95 <= tolerance.percent and of_all.points_p95 <= tolerance.points
    met = most_are and len(worst) <= OUTSIDE * len(beyond)
    training = Training(
        tuple(state.indices[c] for c in state.chosen),
        state.n_grounds,
        of_all.days_median,
        of_all.days_p95,
        of_all.points_p95,
        met,
        digest_of({",".join(map(str, family.labels)): s.digest for family, s in surrogates}),
    )
    predictor = _predictor(state, surrogates, per_deviation, tolerance, training)
    return predictor, worst if most_are else []


def _predictor(
    state: Learning,
    surrogates: Sequence[tuple[Family, Surrogate]],
    per_deviation: Expected,
    tolerance: Expected,
    training: Training,
) -> GroundPredictor:
    by_label = {label: (family, s) for family, s in surrogates for label in family.labels}
    return GroundPredictor(
        state.store,
        {label: surrogate for label, (_, surrogate) in by_label.items()},
        {label: family.kind for label, (family, _) in by_label.items()},
        set[Any]().union(*(state.learnt[c].own for c in state.chosen)),
        per_deviation,
        tolerance,
        training,
    )


def _shares(places: np.ndarray, chosen: list[int]) -> np.ndarray:
    """Share [N] of all sets that is nearest to each of the sets ``chosen``."""
    apart = np.sum((places[:, None, :] - places[None, chosen, :]) ** 2, axis=-1)
    counts = np.bincount(np.argmin(apart, axis=1), minlength=len(chosen))
    return np.asarray(counts / len(places))
