"""Many settlement groups through a few: equivalent cycles give every depth a count of its own.

The weights of the groups of one law are alike as functions of the day, φ′(N + r day) for some thirty r:
a few combinations of them say as much. With W the weights on days spread over the life, each row over
its length, and W = W V Vᵀ to ``TOLERANCE``, weights w are the few w V, and the forms Vᵀ F.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.step_b.case import Case
from mcsettle.step_b.cycles import daily_weights
from mcsettle.step_b.spectral import SettlementForm

TOLERANCE = 1e-6  # of the growth
DAYS = 128  # on which the weights are compared; within day 0 the order of the timetable bends them


@dataclass(frozen=True)
class FewWeights:
    """``form`` and ``multipliers`` [F, C] of C combinations of E groups; ``combined`` [E, C]."""

    form: SettlementForm
    multipliers: np.ndarray
    combined: np.ndarray

    def of(self, weights: np.ndarray) -> np.ndarray:
        """Weights [R, C] of the combinations, from those [R, E] of the groups."""
        total = np.zeros((len(weights), self.combined.shape[1]))
        # Group by group: a matrix product would round differently in other batches.
        for column, row in zip(weights.T, self.combined, strict=True):
            total += column[:, None] * row
        return total


def few_weights(case: Case, form: SettlementForm, multipliers: np.ndarray) -> FewWeights:
    """The combinations of the groups of ``form``, services one after the other, that do for ``case``.

    Groups of different services or laws, or with different ``multipliers`` [F, E] of the fields, stay
    apart: the growth of one service alone is asked for, too.
    """
    days = np.geomspace(1.0, max(case.horizon, 2.0), DAYS)
    scale = 1.0 / form.constant
    weights = daily_weights(case, days) / scale
    laws = case.model.group_laws * len(case.timetable.services)
    n_groups = len(case.model.group_laws)
    keys = [
        (e // n_groups, law, *column)
        for e, (law, column) in enumerate(zip(laws, multipliers.T, strict=True))
    ]
    blocks = []
    for key in dict.fromkeys(keys):
        members = np.array([own == key for own in keys])
        rows = weights[:, members]
        norms = np.linalg.norm(rows, axis=1, keepdims=True)
        if not norms.any():  # a service that settles nothing
            continue
        _, size, v = np.linalg.svd(rows / np.where(norms > 0.0, norms, 1.0))
        few = v[: int(np.sum(size > TOLERANCE * size[0]))]
        block = np.zeros((len(few), len(keys)))
        block[:, members] = few
        blocks.append(block)
    v = np.concatenate(blocks)
    combined = SettlementForm(
        *(
            np.tensordot(v * scale, part, axes=1)
            for part in (form.constant, form.mean, form.linear, form.sums, form.differences)
        )
    )
    at = np.abs(v).argmax(axis=1)
    return FewWeights(combined, multipliers[:, at], (v / scale).T.copy())
