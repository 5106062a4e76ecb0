"""Every set that a surrogate has learnt from, predicted from the others: errors of days and effects."""

from collections.abc import Sequence

import numpy as np

from mcsettle.run.left_out import Days, LeftOut, days_anywhere, left_out
from mcsettle.run.surrogate import Label
from mcsettle.run.surrogate_fit import Family, Learning, weights_left_out
from mcsettle.step_a.processes import Together
from mcsettle.step_a.surrogate import Surrogate
from mcsettle.step_a.transfer import TransferFunctions

AT_ONCE = 8  # sets whose predictions are kept until their days are known

ByScene = dict[tuple[str, str], tuple[TransferFunctions, ...]]  # by variant and scenario


def sets_left_out(
    state: Learning, surrogates: Sequence[tuple[Family, Surrogate]], processes: Together
) -> list[LeftOut]:
    """Errors of every training set, in the order chosen; their days from all ``processes``."""
    errors: list[LeftOut] = []
    for first in range(0, len(state.chosen), AT_ONCE):
        positions = range(first, min(first + AT_ONCE, len(state.chosen)))
        errors += _left_out(state, surrogates, positions, processes)
    return errors


def _left_out(
    state: Learning,
    surrogates: Sequence[tuple[Family, Surrogate]],
    positions: range,
    processes: Together,
) -> list[LeftOut]:
    """Errors of the training sets at ``positions``."""
    sets = [state.chosen[position] for position in positions]
    left = [_combined(state, surrogates, position) for position in positions]
    new = [i for i, candidate in enumerate(sets) if candidate not in state.days]
    jobs = [(state.scenes[c], predicted) for c, (_, predicted, _) in zip(sets, left, strict=True)]
    jobs += [(state.scenes[sets[i]], left[i][0]) for i in new]
    days: list[Days] = processes.map(days_anywhere, jobs)
    for i, exact in zip(new, days[len(sets) :], strict=True):
        state.days[sets[i]] = exact
    return [
        left_out(state.days[c], predicted, deviation, state.baseline)
        for c, predicted, (*_, deviation) in zip(sets, days, left, strict=False)
    ]


def _combined(
    state: Learning, surrogates: Sequence[tuple[Family, Surrogate]], position: int
) -> tuple[ByScene, ByScene, float]:
    """Transfer functions of a training set, the same predicted from the others, and the SD of that.

    None of the first where its days are known.
    """
    candidate = state.chosen[position]
    transfers: list[dict[Label, TransferFunctions]] = [{}, {}]
    deviation = 0.0
    for family, surrogate in surrogates:
        weights, sds = weights_left_out(state, family, surrogate, position)
        deviation = max(deviation, float(np.linalg.norm(sds)))
        passage = state.passages[candidate][family.place]
        for of_label, of_levels in zip(transfers, weights, strict=True):
            if of_label is transfers[0] and candidate in state.days:
                continue
            transfer = surrogate.combined(
                of_levels, passage.scene, passage.service, passage.ground.track, ""
            )
            of_label |= dict.fromkeys(family.labels, transfer)
    exact, predicted = (_by_scene(of_label) for of_label in transfers)
    return exact, predicted, deviation


def _by_scene(transfers: dict[Label, TransferFunctions]) -> ByScene:
    """Transfer functions of each scene, in the order of its timetable."""
    scenes: ByScene = {}
    for (variant, scenario, _), transfer in sorted(transfers.items(), key=lambda item: item[0]):
        scenes[variant, scenario] = (*scenes.get((variant, scenario), ()), transfer)
    return scenes
