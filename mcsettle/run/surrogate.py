"""Which parameter sets have a predicted Step A, and what that costs in accuracy.

The training grounds are parameter sets of the study: first some that are spread over all, then always
those that tell most of the others, until the tolerance is met. Each of them is predicted from the others,
and days and effects are compared: that gives the error per standard deviation of the kriging, and with
it the error of every other set. A set whose error is beyond the tolerance is computed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from mcsettle.railway.scene import Scene
from mcsettle.railway.traffic import Service
from mcsettle.step_a.surrogate import Description, Surrogate, describe
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_a.transfer_cache import scaled_to, under_reference_load
from mcsettle.step_a.transfers import Ground, StepA, TransferStore, passages_of, transfer_key
from mcsettle.storage.location import Place
from mcsettle.storage.store import read
from mcsettle.storage.tables import input_column
from mcsettle.study.parameter_sets import ParameterSet

ERROR = "step_a.error_percent"  # pseudo-input of a parameter set: 0 where Step A was computed


Label = tuple[str, str, int]  # variant, scenario, place in the timetable


class Passage(NamedTuple):
    """One service of a scene with its ground; ``ratio``: its axle load over that of its ``train``.

    Where an axle load only scales, ``service`` runs under that of the study.
    """

    label: Label
    scene: Scene
    service: Service
    ground: Ground
    key: tuple[Any, ...]
    description: Description
    ratio: float


def list_passages(scenes: Sequence[Scene], store: TransferStore) -> list[Passage]:
    """Every service of every scene, in their order."""
    passages: list[Passage] = []
    for scene, service, ground in passages_of(scenes, store):
        reference, ratio = service, 1.0
        if ground.softened is None:
            train = under_reference_load(service.train, store.axle_loads)
            if train is not None:
                reference = replace(service, train=train)
                ratio = service.train.cars[0].axle_load / train.cars[0].axle_load
        place = passages[-1].label[2] + 1 if passages and passages[-1].scene is scene else 0
        label = scene.variant, scene.scenario, place
        key = transfer_key(scene, reference, ground)
        description = describe(scene, reference, ground.track)
        passages.append(Passage(label, scene, reference, ground, key, description, ratio))
    return passages


class Expected(NamedTuple):
    """95 % of the errors of a set's days [%] and effects [percentage points] are below these."""

    percent: float
    points: float


# Passages of a set, the errors of their prediction and their points.
Placed = tuple[list[Passage], Expected | None, list[np.ndarray | None]]


@dataclass(frozen=True)
class Training:
    """What a surrogate has learnt from and how well it predicts.

    ``sets``: parameter sets computed to learn from, -1 the study's own inputs; ``grounds``: how many
    grounds that took; ``median_percent``, ``p95_percent`` and ``p95_points``: errors of days and effects
    where each of them is predicted from the others; ``met``: whether the tolerance was; ``digest`` of the
    surrogate.
    """

    sets: tuple[int, ...]
    grounds: int
    median_percent: float
    p95_percent: float
    p95_points: float
    met: bool
    digest: str

    @property
    def text(self) -> str:
        """One line for people."""
        return (
            f"Step A predicted from {self.grounds} grounds of {len(self.sets)} parameter sets; "
            f"where each set is left out the days are off by {self.median_percent:.2g} % (median; "
            f"95 % by less than {self.p95_percent:.2g} %), and 95 % of the effects by less than "
            f"{self.p95_points:.2g} points"
        )


def surrogate_remarks(members: Sequence[ParameterSet], training: Training | None) -> list[str]:
    """What to say of a run whose Step A is predicted in part."""
    if training is None:
        return []
    predicted = sum(member.values.get(ERROR, 0.0) > 0.0 for member in members)
    remarks = [f"{training.text}; {predicted} of {len(members)} sets are predicted"]
    if not training.met:
        remarks.append(
            "the surrogate of Step A is not within its tolerance: sets beyond it are computed; raise "
            "step_a.most_grounds or a tolerance"
        )
    return remarks


def with_errors(
    members: Sequence[ParameterSet], transfers: TransferStore | None
) -> list[ParameterSet]:
    """``members`` with the error of their Step A among their values, 0 where it is not predicted."""
    predictor = None if transfers is None else transfers.predictor
    if not isinstance(predictor, GroundPredictor):
        return list(members)
    return [
        _with_error(m, 0.0 if m.failure else predictor.error_percent(m.study.scenes))
        for m in members
    ]


def with_stored_errors(members: Sequence[ParameterSet], at: Place) -> list[ParameterSet]:
    """``members`` with the errors that the rows of a results folder have; as they are without any."""
    rows = read(at, "realisations")
    name = input_column(ERROR)
    if name not in rows.column_names:
        return list(members)
    of_set = dict(zip(rows["parameter_set"].to_pylist(), rows[name].to_pylist(), strict=True))
    return [_with_error(member, of_set[member.index]) for member in members]


def _with_error(member: ParameterSet, error: float) -> ParameterSet:
    return replace(member, values=member.values | {ERROR: error})


@dataclass
class GroundPredictor:
    """Step A of parameter sets from that of the training grounds (a ``transfers.Predictor``).

    ``surrogates`` and ``kinds`` by place of a passage in the study; ``computed``: keys of the training
    passages; ``per_deviation``: 95 % error in days [%] and effects [points] per standard deviation;
    ``tolerance`` the most of each.
    """

    store: TransferStore
    surrogates: dict[Label, Surrogate]
    kinds: dict[Label, str]
    computed: set[Any]
    per_deviation: Expected
    tolerance: Expected
    training: Training
    _last: "tuple[Sequence[Scene], Placed] | None" = field(default=None, repr=False)

    def expected(self, scenes: Sequence[Scene]) -> Expected | None:
        """Errors of a prediction; None where something is outside what was learnt.

        Zero for a ground that was computed to learn from.
        """
        return self._placed(scenes)[1]

    def answers(self, scenes: Sequence[Scene]) -> bool:
        """Whether the Step A of ``scenes`` is predicted."""
        expected = self.expected(scenes)
        return (
            expected is not None
            and 0.0 < expected.percent <= self.tolerance.percent
            and expected.points <= self.tolerance.points
        )

    def error_percent(self, scenes: Sequence[Scene]) -> float:
        """95 % error [%] of the days of a set, 0 where its Step A is computed."""
        expected = self.expected(scenes)
        return expected.percent if expected is not None and self.answers(scenes) else 0.0

    def predict(self, scenes: Sequence[Scene]) -> StepA:
        """Step A of scenes within the training."""
        passages, _, points = self._placed(scenes)
        cached: dict[Any, TransferFunctions] = {}
        transfers: dict[tuple[str, str], tuple[TransferFunctions, ...]] = {}
        for passage, point in zip(passages, points, strict=True):
            label, scene, service, ground, key, _, ratio = passage
            if key not in cached:
                assert point is not None
                surrogate = self.surrogates[label]
                cached[key] = surrogate.predict(scene, service, ground.track, point)
            transfer = cached[key]
            if ratio != 1.0:
                transfer = scaled_to(transfer, ratio, f"{transfer.digest}*{ratio!r}")
            pair = scene.variant, scene.scenario
            transfers[pair] = (*transfers.get(pair, ()), transfer)
        return StepA(transfers)

    def _placed(self, scenes: Sequence[Scene]) -> "Placed":
        """Passages of ``scenes``, the errors of their prediction and their points."""
        if self._last is not None and self._last[0] is scenes:
            return self._last[1]
        passages = list_passages(scenes, self.store)
        points: list[np.ndarray | None] = []
        deviation: float | None = 0.0
        for passage in passages:
            point, sd = self._deviation(passage)
            points.append(point)
            deviation = None if sd is None or deviation is None else max(deviation, sd)
        expected = None
        if deviation is not None:
            expected = Expected(*(deviation * each for each in self.per_deviation))
        self._last = scenes, (passages, expected, points)
        return self._last[1]

    def _deviation(self, passage: Passage) -> tuple[np.ndarray | None, float | None]:
        """Point and standard deviation of a passage; None outside."""
        label, description = passage.label, passage.description
        surrogate = self.surrogates.get(label)
        if surrogate is None or self.kinds[label] != description.kind:
            return None, None
        point = surrogate.inputs.point(description.numbers)
        if point is None or not surrogate.fits(passage.scene, passage.ground.track):
            return None, None
        if passage.key in self.computed:
            return point, 0.0
        return point, float(surrogate.deviations(point[None])[0])
