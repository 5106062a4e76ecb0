"""The grounds from which a surrogate of Step A learns, and what is computed on each of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from mcsettle.errors import InputError, NumericalError
from mcsettle.railway.scene import Scene
from mcsettle.railway.traffic import Service, Timetable
from mcsettle.run.surrogate import Passage
from mcsettle.step_a.surrogate import Arrays, stacked
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_a.transfers import Ground, TransferStore, transfer_on


@dataclass(frozen=True)
class TrainingGround:
    """A ground and the passages that are computed on it."""

    ground: Ground
    passages: tuple[Passage, ...]


@dataclass(frozen=True, eq=False)
class Learnt:
    """Step A of a set, by key of its passages: on linear soil, or on the ground of the highest speed.

    ``softening``: what a ground that the speed itself has softened changes, where both grounds are
    computed; ``own``: keys of the passages on the ground that is their own.
    """

    transfers: dict[Any, TransferFunctions]
    softening: dict[Any, Arrays]
    own: frozenset[Any]


def training_grounds(passages: Sequence[Passage], both: bool) -> list[TrainingGround]:
    """Grounds of a set to learn from, each for all speeds of its trains.

    On soil that softens that of each train's highest speed and, with ``both``, that of its lowest.
    """
    trains: dict[Ground, dict[Any, Passage]] = {}
    for p in passages:
        alike = p.ground
        if alike.softened is not None:
            alike = alike._replace(softened=replace(alike.softened, speed=0.0), settings=None)
        trains.setdefault(alike, {})[p.key] = p
    grounds = []
    for members in (tuple(of_train.values()) for of_train in trains.values()):
        slowest, fastest = _ends(members)
        grounds.append(TrainingGround(fastest.ground, members))
        if both and _softened_apart(slowest, fastest):
            # The ground of the lowest speed is asked at the highest, too.
            wide = slowest.ground._replace(settings=fastest.ground.settings)
            grounds.append(TrainingGround(wide, members))
    return grounds


def scenes_learnt_from(passages: Sequence[Passage]) -> tuple[Scene, ...]:
    """Scenes of a set, its trains under the loads of the study where loads only scale."""
    services: dict[Scene, tuple[Service, ...]] = {}
    for p in passages:
        services[p.scene] = (*services.get(p.scene, ()), p.service)
    return tuple(
        replace(scene, timetable=Timetable(of_scene)) for scene, of_scene in services.items()
    )


OnGround = dict[Any, TransferFunctions]  # by key of the passage


def computed_on(
    training: TrainingGround, scenes: Sequence[Scene], store: TransferStore
) -> OnGround | None:
    """Transfer functions on one ground, kept in the cache folder; None where they cannot be computed."""
    own = store.emptied()
    try:
        return {
            p.key: transfer_on(training.ground, p.scene, p.service, scenes, own)
            for p in training.passages
        }
    except (InputError, NumericalError):
        return None


def learnt_on(
    grounds: Sequence[TrainingGround], on_grounds: Sequence[OnGround | None]
) -> Learnt | None:
    """Step A of a set on its training grounds; None where one of them cannot be computed.

    Between the lowest and the highest speed what the softening changes is linear in the speed.
    """
    transfers: OnGround = {}
    softening: dict[Any, Arrays] = {}
    own = set[Any]()
    for training, on_ground in zip(grounds, on_grounds, strict=True):
        if on_ground is None:
            return None
        slowest, fastest = (p.service.speed for p in _ends(training.passages))
        softens = training.ground.softened is not None
        own |= {p.key for p in training.passages if not softens or p.service.speed == fastest}
        for p in training.passages:
            if p.key not in transfers:
                transfers[p.key] = on_ground[p.key]
            elif p.service.speed < fastest:
                share = (fastest - p.service.speed) / (fastest - slowest)
                there, here = (stacked([t[p.key]]) for t in (on_ground, transfers))
                softening[p.key] = {name: share * (there[name] - here[name])[0] for name in here}
    return Learnt(transfers, softening, frozenset(own))


def _ends(passages: Sequence[Passage]) -> tuple[Passage, Passage]:
    """The slowest and the fastest."""
    ordered = sorted(passages, key=lambda p: p.service.speed)
    return ordered[0], ordered[-1]


def _softened_apart(slowest: Passage, fastest: Passage) -> bool:
    return fastest.ground.softened is not None and slowest.service.speed < fastest.service.speed
