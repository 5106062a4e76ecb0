"""Step A of a study: one set of transfer functions for every distinct track, train and speed.

What was computed once is kept in the cache folder under the digest of everything it depends on, so a
change of Step B or of the economics costs nothing here.
"""

import hashlib
import math
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.track import SectionTrack, Track
from mcsettle.railway.traffic import Service, Train
from mcsettle.step_a.critical_speed import speed_remark
from mcsettle.step_a.interaction import precompute, transfer_digest
from mcsettle.step_a.transfer import TrackResponse, TransferFunctions
from mcsettle.step_a.transfer_file import keep_newest, load, save
from mcsettle.storage.files import cache_folder
from mcsettle.storage.shared_cache import bring, share
from mcsettle.study.study import Study

if TYPE_CHECKING:
    from mcsettle.step_a.fem25d import Settings
from mcsettle.step_a.track_response import Softened, track_response
from mcsettle.study.study import study_wavenumbers
from mcsettle.types import Progress

LARGEST_CACHE = (
    4_000_000_000  # bytes of transfer functions kept: drawn vehicles leave one file a set
)
# Keys of a layer that its bases depend on; laws, strengths and K0 leave them as they are.
ELASTIC = {"youngs_modulus_pa", "poisson", "density_kg_per_m3", "damping"}


@dataclass(frozen=True)
class StepA:
    """Transfer functions of a study by (variant, scenario): one per service, in timetable order.

    ``remarks`` are on trains near the critical speed, where they were asked for.
    """

    transfers: dict[tuple[str, str], tuple[TransferFunctions, ...]]
    remarks: tuple[str, ...] = ()

    @property
    def digest(self) -> str:
        """SHA-256 [hex] over all transfer functions."""
        digests = sorted({t.digest for group in self.transfers.values() for t in group})
        return hashlib.sha256("\n".join(digests).encode()).hexdigest()


def softened_by(study: Study, variant: str | None, service: Service) -> Softened | None:
    """What softens the ground of ``variant`` under ``service``; None where the soil is linear."""
    settings = study.softening(variant)
    return None if settings is None else Softened(service.train, service.speed, settings)


def section_settings(
    study: Study, softened: Softened | None = None, own: bool = False
) -> "Settings | None":
    """Step A's range for a study, rounded up; None: the default one, which most studies share.

    A range of its own goes to a ground that no other study has: one softened by one train, or
    (``own``) one of many. A smaller range takes fewer solutions. Beyond the default range shear waves
    near the mesh's resolution make the bases a little less accurate.
    """
    from mcsettle.step_a.fem25d.settings import Settings, many_grounds_settings

    if softened is None:
        timetables = [study.timetable(scenario) for scenario in study.scenario_names]
        speed = max(service.speed for table in timetables for service in table.services)
    else:
        speed = softened.speed
    omega, usual = speed * float(study_wavenumbers(study).max()), Settings()
    usual_will_do = speed <= usual.max_speed and omega <= usual.max_omega
    if usual_will_do and softened is None and not own:
        return None
    max_speed, max_omega = 25.0 * math.ceil(speed / 25.0), 20.0 * math.ceil(omega / 20.0)
    if own:
        return many_grounds_settings(max_speed, max_omega)
    return Settings(
        max_speed=max_speed, max_omega=max_omega, held_out=1 if softened else usual.held_out
    )


Ground = tuple[Track, float, Softened | None, "Settings | None"]  # and the integration depth [m]


@dataclass
class Shelf:
    """Step A at hand between the parameter sets of a study: its own and the last set's.

    ``axle_loads`` [kg] are the study's own, by train. A train that differs in them alone has the
    same dynamic response and a quasi-static one in proportion, so it is scaled, not computed.
    With ``many_grounds`` every set has a track or a ground of its own.
    """

    responses: dict[Ground, TrackResponse] = field(default_factory=dict)
    found: dict[Any, TransferFunctions] = field(default_factory=dict)
    axle_loads: dict[str, float] = field(default_factory=dict)
    first: set[Any] = field(default_factory=set)
    many_grounds: bool = False

    @classmethod
    def of(cls, study: Study) -> "Shelf":
        """An empty shelf for the parameter sets of ``study``."""
        loads = {name: train.cars[0].axle_load for name, train in study.trains.items()}
        inputs = [path for entry in study.uncertain for path in (entry.input, *entry.also)]
        many = study.grounds_table is not None or any(
            path.startswith("track.") and path.rsplit(".", 1)[-1] in ELASTIC for path in inputs
        )
        return cls(axle_loads=loads, many_grounds=many)

    def trim(self, used: set[Any]) -> None:
        """Forget what was not used just now, nor the first time."""
        self.first = self.first or used
        for table in (self.responses, self.found):
            for key in set(table) - used - self.first:
                del table[key]


def _passages(
    study: Study, shelf: Shelf, laws: bool = False
) -> Iterator[tuple[str, str, Service, Ground]]:
    """Variant, scenario, service and ground of every passage of a study, in their order.

    Settlement laws belong to Step B: without ``laws`` grounds that differ in them alone are one.
    """
    for variant in study.variant_names:
        track = study.track(variant) if laws else _without_laws(study.track(variant))
        depth = study.settlement_settings(variant).integration_depth_m
        for scenario in study.scenario_names:
            for service in study.timetable(scenario).services:
                softened = softened_by(study, variant, service)
                settings = section_settings(study, softened, own=shelf.many_grounds)
                yield variant, scenario, service, (track, depth, softened, settings)


def step_a(
    study: Study,
    progress: Progress | None = None,
    workers: int = 1,
    shelf: Shelf | None = None,
    check_speeds: bool = False,
) -> StepA:
    """Transfer functions of every variant and scenario, computed once where equal, kept on disk.

    With a ``shelf`` what is on it is taken, and what was needed is put there. With ``check_speeds``
    trains near the critical speed of track and ground are remarked on.
    """
    share, shelf = shelf is not None, shelf or Shelf()
    modes, contact = study_wavenumbers(study), study.track_table.hertz_stiffness_n_per_m
    responses, found = shelf.responses, shelf.found
    if workers > 1:
        _soften_ahead(study, shelf, modes, progress, workers)
    transfers: dict[tuple[str, str], tuple[TransferFunctions, ...]] = {}
    used, near = set[Any](), dict[str | None, None]()
    for variant, scenario, service, ground in _passages(study, shelf, laws=not share):
        track, depth, softened, settings = ground
        key = (*ground, Service(service.train, service.speed, 1), contact)
        if key not in found:
            if ground not in responses:
                responses[ground] = track_response(
                    track, depth, progress, workers, softened, settings
                )
            # On soil that softens the axle load decides the ground: nothing is in proportion.
            own = shelf.axle_loads if softened is None else {}
            found[key] = _transfer(responses[ground], service, modes, contact, progress, own)
        transfers[variant, scenario] = (*transfers.get((variant, scenario), ()), found[key])
        used |= {key, ground}
        if check_speeds and ground in responses:
            near[speed_remark(service, responses[ground], softened is not None)] = None
    shelf.trim(used)
    return StepA(transfers, tuple(remark for remark in near if remark is not None))


def needs(study: Study, shelf: Shelf) -> set[Any]:
    """Keys of all that ``step_a`` computes for ``study`` with a ``shelf``; equal keys, equal results.

    Trains that differ in an axle load which only scales have one key each but one computation.
    """
    contact = study.track_table.hertz_stiffness_n_per_m
    found = set()
    for _, _, service, ground in _passages(study, shelf):
        softened, train = ground[2], service.train
        if softened is None:
            train = _as_in(train, shelf.axle_loads) or train
        found.add((*ground, Service(train, service.speed, 1), contact))
    return found


def _soften_ahead(
    study: Study, shelf: Shelf, modes: np.ndarray, progress: Progress | None, workers: int
) -> None:
    """Compute the softened grounds of a study side by side, and leave them in the cache folder."""
    contact = study.track_table.hertz_stiffness_n_per_m
    asked = dict.fromkeys(
        ground
        for _, _, _, ground in _passages(study, shelf)
        if ground[2] is not None and ground not in shelf.responses
    )
    jobs = [ground for ground in asked if not _at_hand(ground, modes, contact)]
    if len(jobs) < 2:
        return
    from mcsettle.step_a.fem25d.section_response import worker_environment

    context = multiprocessing.get_context("spawn")
    with (
        worker_environment(),
        ProcessPoolExecutor(min(workers, len(jobs)), mp_context=context) as pool,
    ):
        running = [pool.submit(_ahead, ground, modes, contact) for ground in jobs]
        for done, finished in enumerate(as_completed(running), 1):
            finished.result()
            if progress is not None:
                progress("Step A: equivalent-linear grounds", done, len(jobs))


def _ahead(ground: Ground, modes: np.ndarray, contact: float) -> None:
    """One softened ground and its transfer functions, into the cache folder."""
    track, depth, softened, settings = ground
    assert softened is not None
    response = track_response(track, depth, softened=softened, settings=settings)
    _computed(response, Service(softened.train, softened.speed, 1), modes, contact, None)


def _at_hand(ground: Ground, modes: np.ndarray, contact: float) -> bool:
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
    response = track_response(track, depth, softened=softened, settings=settings)
    path = _transfer_file(transfer_digest(train, speed, modes, contact, response.digest))
    bring(path)
    return path.exists()


def _transfer_file(digest: str) -> Path:
    return cache_folder() / f"transfer-{digest[:32]}.npz"


def _without_laws(track: Track) -> Track:
    return replace(track, layers=tuple(replace(layer, law=None) for layer in track.layers))


def scaled_to(transfer: TransferFunctions, ratio: float, digest: str) -> TransferFunctions:
    """``transfer`` of the same train under axle loads ``ratio`` times as large."""
    return replace(
        transfer,
        quasi_static=transfer.quasi_static * ratio,
        rail_deflection=transfer.rail_deflection * ratio,
        digest=digest,
    )


def _transfer(
    response: TrackResponse,
    service: Service,
    modes: np.ndarray,
    contact: float,
    progress: Progress | None,
    axle_loads: dict[str, float],
) -> TransferFunctions:
    """One set of transfer functions, scaled from that of the train's axle load in ``axle_loads``."""
    train = service.train
    usual = _as_in(train, axle_loads)
    if usual is None:
        return _computed(response, service, modes, contact, progress)
    base = replace(service, train=usual)
    ratio = train.cars[0].axle_load / usual.cars[0].axle_load
    digest = transfer_digest(train, service.speed, modes, contact, response.digest)
    return scaled_to(_computed(response, base, modes, contact, progress), ratio, digest)


def _as_in(train: Train, axle_loads: dict[str, float]) -> Train | None:
    """``train`` under its axle load in ``axle_loads``; None if that is its own, or it has several."""
    load, own = axle_loads.get(train.name), train.cars[0].axle_load
    unlike = len({car.axle_load for car in train.cars}) > 1 or any(c.axle_loads for c in train.cars)
    if load is None or load == own or unlike:
        return None
    return replace(train, cars=tuple(replace(car, axle_load=load) for car in train.cars))


def _computed(
    response: TrackResponse,
    service: Service,
    modes: np.ndarray,
    contact: float,
    progress: Progress | None,
) -> TransferFunctions:
    """One set of transfer functions, from the cache if it is there and sound."""
    digest = transfer_digest(service.train, service.speed, modes, contact, response.digest)
    path = _transfer_file(digest)
    bring(path)
    if path.exists():
        try:
            found = load(path)
            if found.digest == digest:
                path.touch()  # used last: kept longest
                return found
            raise InputError(f"{path} holds the transfer functions of something else")
        except InputError as error:
            if progress is not None:
                progress(f"Recomputing a damaged cache file ({error})", 1, 1)
    text = f"Step A: {service.train.name} at {service.speed * 3.6:.0f} km/h"
    steps = None if progress is None else lambda done, total: progress(text, done, total)
    transfer = precompute(service.train, service.speed, response, modes, contact, steps)
    save(transfer, path)
    share(path)
    keep_newest(path.parent, "transfer-*.npz", LARGEST_CACHE)
    return transfer
