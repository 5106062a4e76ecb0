"""Step A of scenes: one set of transfer functions for every distinct track, train and speed.

What was computed once is kept in the cache folder under the digest of everything it depends on, so a
change of Step B or of the economics costs nothing here.
"""

import hashlib
import math
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from mcsettle.railway.scene import Scene
from mcsettle.railway.softening_choices import Softened
from mcsettle.railway.track import SectionTrack, Track, without_laws
from mcsettle.railway.traffic import Service
from mcsettle.step_a.critical_speed import speed_remark
from mcsettle.step_a.interaction import transfer_digest
from mcsettle.step_a.processes import process_pool
from mcsettle.step_a.track_response import track_response
from mcsettle.step_a.transfer import TrackResponse, TransferFunctions
from mcsettle.step_a.transfer_cache import cached_transfer, transfer_file, under_reference_load
from mcsettle.storage.files import cache_folder
from mcsettle.storage.shared_cache import bring
from mcsettle.types import Progress, silent

if TYPE_CHECKING:
    from mcsettle.step_a.fem25d import Settings


@dataclass(frozen=True)
class StepA:
    """Transfer functions by (variant, scenario): one per service, in timetable order.

    ``remarks`` are on trains near the critical speed, where they were asked for.
    """

    transfers: dict[tuple[str, str], tuple[TransferFunctions, ...]]
    remarks: tuple[str, ...] = ()

    @property
    def digest(self) -> str:
        """SHA-256 [hex] over all transfer functions."""
        digests = sorted({t.digest for group in self.transfers.values() for t in group})
        return hashlib.sha256("\n".join(digests).encode()).hexdigest()

    def of_variant(self, variant: str) -> "StepA":
        """Those of one variant, without remarks."""
        return StepA({key: group for key, group in self.transfers.items() if key[0] == variant})


class Ground(NamedTuple):
    """What a track response depends on; ``integration_depth`` m, ``settings`` None: the default."""

    track: Track
    integration_depth: float
    softened: Softened | None
    settings: "Settings | None"


class Predictor(Protocol):
    """Predicts Step A from that of other grounds."""

    def answers(self, scenes: Sequence[Scene]) -> bool:
        """Whether the Step A of ``scenes`` is predicted; if not, it is computed."""
        ...

    def predict(self, scenes: Sequence[Scene]) -> StepA:
        """Step A of scenes that are predicted."""
        ...


@dataclass
class TransferStore:
    """Step A kept between the parameter sets of a study: that of the first set and of the last.

    ``axle_loads`` [kg] are the study's own, by train (see ``transfer_cache.cached_transfer``). With
    ``many_grounds`` every set has a track or a ground of its own; a ``predictor`` answers for those
    scenes that it can answer for.
    """

    responses: dict[Ground, TrackResponse] = field(default_factory=dict)
    transfers: dict[Any, TransferFunctions] = field(default_factory=dict)
    axle_loads: dict[str, float] = field(default_factory=dict)
    first: set[Any] = field(default_factory=set)
    many_grounds: bool = False
    predictor: "Predictor | None" = None

    def emptied(self) -> "TransferStore":
        """An empty store for the same study, without a predictor."""
        return TransferStore(axle_loads=self.axle_loads, many_grounds=self.many_grounds)

    def trim(self, used: set[Any]) -> None:
        """Forget what was not used just now, nor the first time."""
        self.first = self.first or used
        for table in (self.responses, self.transfers):
            for key in set(table) - used - self.first:
                del table[key]


def step_a(
    scenes: Sequence[Scene],
    progress: Progress = silent,
    workers: int = 1,
    store: TransferStore | None = None,
    check_speeds: bool = False,
) -> StepA:
    """Transfer functions of every scene, computed once where equal, kept on disk.

    With a ``store`` what is in it is taken, and what was needed is put there; what its predictor answers
    for is predicted. With ``check_speeds`` trains near the critical speed of track and ground are
    remarked on.
    """
    shared, store = store is not None, store or TransferStore()
    if store.predictor is not None and store.predictor.answers(scenes):
        return store.predictor.predict(scenes)
    if workers > 1:
        _soften_ahead(scenes, store, progress, workers)
    transfers: dict[tuple[str, str], tuple[TransferFunctions, ...]] = {}
    used, remarks = set[Any](), dict[str | None, None]()
    for scene, service, ground in passages_of(scenes, store, laws=not shared):
        key = transfer_key(scene, service, ground)
        if key not in store.transfers:
            store.transfers[key] = transfer_on(
                ground, scene, service, scenes, store, progress, workers
            )
        pair = scene.variant, scene.scenario
        transfers[pair] = (*transfers.get(pair, ()), store.transfers[key])
        used |= {key, ground}
        if check_speeds and ground in store.responses:
            softened = ground.softened is not None
            remarks[speed_remark(service, store.responses[ground], softened)] = None
    store.trim(used)
    return StepA(transfers, tuple(remark for remark in remarks if remark is not None))


def transfer_on(
    ground: Ground,
    scene: Scene,
    service: Service,
    scenes: Sequence[Scene],
    store: TransferStore,
    progress: Progress = silent,
    workers: int = 1,
) -> TransferFunctions:
    """Transfer functions of a service of a scene, one of ``scenes``, on ``ground``, kept on disk."""
    if ground not in store.responses:
        store.responses[ground] = _response(ground, progress, workers)
    # On soil that softens the axle load decides the ground: nothing is in proportion.
    loads = store.axle_loads if ground.softened is None else {}
    response, modes = store.responses[ground], scene.wavenumbers
    small = partial(_small_strain, scenes, store, ground, progress, workers)
    return cached_transfer(
        response, service, modes, scene.contact, progress, loads, scene.rail_loads, small
    )


def into_cache(scenes: Sequence[Scene], store: TransferStore) -> None:
    """``step_a`` in another process: what it computes stays in the cache folder."""
    step_a(scenes, store=store)


def needs(scenes: Sequence[Scene], store: TransferStore) -> set[Any]:
    """Keys of all that ``step_a`` computes for ``scenes`` with a ``store``; equal keys, equal results.

    Trains that differ in an axle load which only scales have one key each but one computation. What is
    predicted needs nothing.
    """
    keys = set[Any]()
    if store.predictor is not None and store.predictor.answers(scenes):
        return keys
    for scene, service, ground in passages_of(scenes, store):
        train = service.train
        if ground.softened is None:
            train = under_reference_load(train, store.axle_loads) or train
        keys.add(transfer_key(scene, replace(service, train=train), ground))
    return keys


def section_settings(
    scenes: Sequence[Scene], softened: Softened | None = None, many_grounds: bool = False
) -> "Settings | None":
    """Step A's range for ``scenes``, rounded up; None: the default one, which most studies share.

    A range of its own goes to a ground that no other study has: one softened by one train, or one of
    ``many_grounds``. A smaller range takes fewer solutions. Beyond the default range shear waves near
    the mesh's resolution make the bases a little less accurate.
    """
    from mcsettle.step_a.fem25d.settings import Settings, many_grounds_settings

    if softened is None:
        services = [service for scene in scenes for service in scene.timetable.services]
        speed = max(service.speed for service in services)
    else:
        speed = softened.speed
    omega, default = speed * float(scenes[0].wavenumbers.max()), Settings()
    within_default = speed <= default.max_speed and omega <= default.max_omega
    if within_default and softened is None and not many_grounds:
        return None
    max_speed, max_omega = 25.0 * math.ceil(speed / 25.0), 20.0 * math.ceil(omega / 20.0)
    if many_grounds:
        return many_grounds_settings(max_speed, max_omega, softened is not None)
    return Settings(
        max_speed=max_speed, max_omega=max_omega, held_out=1 if softened else default.held_out
    )


def passages_of(
    scenes: Sequence[Scene], store: TransferStore, laws: bool = False
) -> Iterator[tuple[Scene, Service, Ground]]:
    """Every service of every scene, in their order, with the ground under it.

    Settlement laws belong to Step B: without ``laws`` grounds that differ in them alone are one.
    """
    many, linear = store.many_grounds, section_settings(scenes, None, store.many_grounds)
    for scene in scenes:
        track = scene.track if laws else without_laws(scene.track)
        for service in scene.timetable.services:
            softened = scene.softened(service)
            settings = linear if softened is None else section_settings(scenes, softened, many)
            yield scene, service, Ground(track, scene.integration_depth, softened, settings)


def transfer_key(scene: Scene, service: Service, ground: Ground) -> tuple[Any, ...]:
    """What a set of transfer functions depends on; equal keys, equal results."""
    return (*ground, Service(service.train, service.speed, 1), scene.contact, scene.rail_loads)


def _small_strain(
    scenes: Sequence[Scene], store: TransferStore, ground: Ground, progress: Progress, workers: int
) -> TrackResponse:
    """Response of the track of ``ground`` at small strain."""
    settings = section_settings(scenes, None, store.many_grounds)
    linear = (
        ground if ground.softened is None else ground._replace(softened=None, settings=settings)
    )
    if linear not in store.responses:
        store.responses[linear] = _response(linear, progress, workers)
    return store.responses[linear]


def _response(ground: Ground, progress: Progress = silent, workers: int = 1) -> TrackResponse:
    track, depth, softened, settings = ground
    return track_response(track, depth, progress, workers, softened, settings)


def _soften_ahead(
    scenes: Sequence[Scene], store: TransferStore, progress: Progress, workers: int
) -> None:
    """Compute the softened grounds of ``scenes`` side by side, and leave them in the cache folder."""
    modes, contact = scenes[0].wavenumbers, scenes[0].contact
    grounds = dict.fromkeys(
        ground
        for _, _, ground in passages_of(scenes, store)
        if ground.softened is not None and ground not in store.responses
    )
    missing = [ground for ground in grounds if not _is_cached(ground, modes, contact)]
    if len(missing) < 2:
        return
    with process_pool(min(workers, len(missing))) as pool:
        running = [pool.submit(_compute_softened, ground, modes, contact) for ground in missing]
        for done, finished in enumerate(as_completed(running), 1):
            finished.result()
            progress("Step A: equivalent-linear grounds", done, len(missing))


def _compute_softened(ground: Ground, modes: np.ndarray, contact: float) -> None:
    """One softened ground and its transfer functions, into the cache folder."""
    assert ground.softened is not None
    service = Service(ground.softened.train, ground.softened.speed, 1)
    cached_transfer(_response(ground), service, modes, contact)


def _is_cached(ground: Ground, modes: np.ndarray, contact: float) -> bool:
    """Whether the cache folder has the transfer functions on a softened ground."""
    from mcsettle.step_a.fem25d.equivalent_linear import softening_file
    from mcsettle.step_a.fem25d.settings import Settings

    track, depth, softened, settings = ground
    assert softened is not None
    assert isinstance(track, SectionTrack)  # a beam has nothing that softens
    train, speed, mesh = softened.train, softened.speed, (settings or Settings()).mesh
    path = softening_file(track, train, speed, depth, mesh, softened.settings, cache_folder())
    bring(path)
    if not path.exists():
        return False
    digest = _response(ground).digest
    path = transfer_file(transfer_digest(train, speed, modes, contact, digest))
    bring(path)
    return path.exists()
