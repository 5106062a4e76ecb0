"""What a training of the surrogate has computed, and the kriging that follows from it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mcsettle.railway.scene import Scene
from mcsettle.run.left_out import Days
from mcsettle.run.surrogate import Label, Passage
from mcsettle.run.training_grounds import Learnt, training_grounds
from mcsettle.step_a.kriging import Kriging, fitted, remainder
from mcsettle.step_a.surrogate import (
    Arrays,
    Inputs,
    Level,
    Surrogate,
    inner_products,
    inputs_of,
    stacked,
)
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_a.transfers import TransferStore


@dataclass(frozen=True, eq=False)
class Family:
    """One service in all candidates, and others with the same passages.

    ``labels``: their places in the study; ``place`` in the passages of a set; ``points`` [S, D].
    """

    kind: str
    labels: tuple[Label, ...]
    place: int
    inputs: Inputs
    points: np.ndarray


LevelFit = tuple[Kriging, float]  # of a level, with its remainder relative to that of the first
Learned = list[tuple[Family, Surrogate]]  # families with the same points


@dataclass(eq=False)
class Learning:
    """State of a training: candidates, what is computed of them, in the order chosen.

    ``families`` by points that they have in common; ``refused``: sets that cannot be computed; ``days``
    of those that can.
    """

    store: TransferStore
    baseline: str
    indices: list[int]
    scenes: list[tuple[Scene, ...]]
    passages: list[list[Passage]]
    families: list[list[Family]]
    places: np.ndarray
    chosen: list[int] = field(default_factory=list)
    refused: list[int] = field(default_factory=list)
    both: list[int] = field(default_factory=list)
    learnt: dict[int, Learnt] = field(default_factory=dict)
    days: dict[int, Days] = field(default_factory=dict)

    @property
    def n_grounds(self) -> int:
        """Grounds computed so far, those of each set counted."""
        return sum(self.grounds_of(c, c in self.both) for c in self.chosen)

    def grounds_of(self, candidate: int, both: bool) -> int:
        """How many grounds a candidate takes."""
        return len(training_grounds(self.passages[candidate], both))


def families_of(passages: list[list[Passage]]) -> list[list[Family]]:
    """Families of passages, those with the same points together."""
    places: dict[tuple[str, bytes], list[int]] = {}
    for place, passage in enumerate(passages[0]):
        numbers = np.stack([of_set[place].description.numbers for of_set in passages])
        places.setdefault((passage.description.kind, numbers.tobytes()), []).append(place)
    groups: dict[tuple[str, bytes], list[Family]] = {}
    for (kind, _), alike in places.items():
        numbers = np.stack([of_set[alike[0]].description.numbers for of_set in passages])
        inputs = inputs_of(numbers)
        points = np.stack([_point(inputs, row) for row in numbers])
        labels = tuple(passages[0][place].label for place in alike)
        family = Family(kind, labels, alike[0], inputs, points)
        groups.setdefault((kind, points.tobytes()), []).append(family)
    return list(groups.values())


def _point(inputs: Inputs, numbers: np.ndarray) -> np.ndarray:
    point = inputs.point(numbers)
    assert point is not None
    return point


def surrogates_of(
    state: Learning, fits: Sequence[Sequence[LevelFit]] | None = None
) -> list[Learned]:
    """Surrogate of every family from what is computed; ``fits`` of each level, if found before."""
    groups = []
    for place, families in enumerate(state.families):
        stacks = [_stacks(state, family) for family in families]
        fit = _fitted(state, families, stacks) if fits is None else fits[place]
        groups.append(
            [
                (family, _surrogate(state, family, of_family, fit))
                for family, of_family in zip(families, stacks, strict=True)
            ]
        )
    return groups


def fits_of(group: Learned) -> list[LevelFit]:
    """Fit of each level of families with the same points, not all of which have all levels."""
    levels = max((surrogate.levels for _, surrogate in group), key=len)
    return [(level.kriging, level.remainder) for level in levels]


def _fitted(
    state: Learning, families: Sequence[Family], stacks: Sequence[list[Arrays]]
) -> list[LevelFit]:
    products: list[list[np.ndarray]] = [[], []]
    for family, levels in zip(families, stacks, strict=True):
        for of_level, arrays in zip(products, levels, strict=False):
            of_level.append(inner_products(arrays, levels[0], _like(state, family)))
    krigings, sizes = list[Kriging](), list[float]()
    for grams, sets in zip(products, (state.chosen, state.both), strict=True):
        if grams:
            gram, points = np.sum(grams, axis=0), families[0].points[sets]
            # A third of the points says too little of lengths: those of the first level serve both.
            krigings.append(fitted(points, gram, krigings[0].lengths if krigings else None))
            sizes.append(remainder(krigings[-1], gram))
    return [(k, size / max(sizes[0], 1e-300)) for k, size in zip(krigings, sizes, strict=True)]


def _surrogate(
    state: Learning, family: Family, stacks: list[Arrays], fits: Sequence[LevelFit]
) -> Surrogate:
    levels = []
    of_levels = zip((state.chosen, state.both), stacks, fits, strict=False)
    for sets, arrays, (kriging, size) in of_levels:
        sources = tuple(_transfer(state, family, c).digest for c in sets)
        levels.append(Level(kriging, arrays, sources, size))
    return Surrogate(family.inputs, _like(state, family), tuple(levels))


def _stacks(state: Learning, family: Family) -> list[Arrays]:
    """Training arrays of each level of a family: one where nothing softens, or not apart."""
    keys = {c: state.passages[c][family.place].key for c in state.chosen}
    levels = [stacked([state.learnt[c].transfers[keys[c]] for c in state.chosen])]
    apart = [state.learnt[c].softening.get(keys[c]) for c in state.both]
    if len(apart) > 1 and all(arrays is not None for arrays in apart):
        levels.append({name: np.stack([a[name] for a in apart if a]) for name in levels[0]})
    return levels


def _transfer(state: Learning, family: Family, candidate: int) -> TransferFunctions:
    key = state.passages[candidate][family.place].key
    return state.learnt[candidate].transfers[key]


def _like(state: Learning, family: Family) -> TransferFunctions:
    return _transfer(state, family, state.chosen[0])


def weights_left_out(
    state: Learning, family: Family, surrogate: Surrogate, position: int
) -> tuple[tuple[list[np.ndarray], list[np.ndarray]], list[float]]:
    """Weights of each level with a training set and without it, and SDs of the error without it.

    Where nothing is known of what its softening changes, both are without that.
    """
    candidate = state.chosen[position]
    known, left, sds = [], [], []
    for sets, level in zip((state.chosen, state.both), surrogate.levels, strict=False):
        if candidate not in sets:
            known.append(np.zeros(len(sets)))
            left.append(np.zeros(len(sets)))
            continue
        row = sets.index(candidate)
        weights, deviations = (a[row] for a in level.kriging.left_out())
        known.append(np.eye(len(sets))[row])
        left.append(weights)
        sds.append(level.remainder * float(deviations))
    return (known, left), sds
