"""One set of transfer functions: from the cache folder if it is valid there, else computed and kept."""

import contextlib
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.rail_loads import HALF, RailLoads
from mcsettle.railway.traffic import Service, Train
from mcsettle.step_a.interaction import precompute, transfer_digest
from mcsettle.step_a.rail_bending import with_rail_bending
from mcsettle.step_a.transfer import TrackResponse, TransferFunctions
from mcsettle.step_a.transfer_file import keep_newest, load, save
from mcsettle.storage.files import cache_folder
from mcsettle.storage.shared_cache import bring, kept, share
from mcsettle.types import Progress, silent

# Bytes of transfer functions kept: drawn vehicles leave one file per parameter set.
LARGEST_CACHE = 4_000_000_000


def cached_transfer(
    response: TrackResponse,
    service: Service,
    modes: np.ndarray,
    contact: float,
    progress: Progress = silent,
    axle_loads: dict[str, float] | None = None,
    loads: RailLoads = HALF,
    small_strain: Callable[[], TrackResponse] | None = None,
) -> TransferFunctions:
    """Transfer functions of one service on ``response``.

    ``modes`` [K] rad/m; ``contact``: Hertzian stiffness N/m. A train that differs from its axle load
    [kg] in ``axle_loads`` alone has the same dynamic response and a quasi-static one in proportion, so
    it is scaled, not computed. ``small_strain`` gives the response of the same track at small strain,
    which the bending of ``loads`` needs (default ``response``).
    """
    train = service.train
    reference = under_reference_load(train, axle_loads or {})
    passage = _Passage(response, service, modes, contact, loads, small_strain)
    if reference is None:
        return _from_cache_or_computed(passage, progress)
    base = replace(service, train=reference)
    transfer = _from_cache_or_computed(replace(passage, service=base), progress)
    ratio = train.cars[0].axle_load / reference.cars[0].axle_load
    return scaled_to(transfer, ratio, passage.digest)


@dataclass(frozen=True)
class _Passage:
    """All that a set of transfer functions depends on."""

    response: TrackResponse
    service: Service
    modes: np.ndarray
    contact: float
    loads: RailLoads
    small_strain: Callable[[], TrackResponse] | None

    @property
    def digest(self) -> str:
        """That of the transfer functions."""
        train, speed = self.service.train, self.service.speed
        known = self.modes, self.contact, self.response.digest, self.loads
        return transfer_digest(train, speed, *known)


def scaled_to(transfer: TransferFunctions, ratio: float, digest: str) -> TransferFunctions:
    """``transfer`` of the same train under axle loads ``ratio`` times as large."""
    return replace(
        transfer,
        quasi_static=transfer.quasi_static * ratio,
        rail_deflection=transfer.rail_deflection * ratio,
        digest=digest,
    )


def under_reference_load(train: Train, axle_loads: dict[str, float]) -> Train | None:
    """``train`` under its axle load in ``axle_loads``; None if that is its own, or it has several."""
    load, present = axle_loads.get(train.name), train.cars[0].axle_load
    several = len({car.axle_load for car in train.cars}) > 1 or any(
        car.axle_loads for car in train.cars
    )
    if load is None or load == present or several:
        return None
    return replace(train, cars=tuple(replace(car, axle_load=load) for car in train.cars))


def transfer_file(digest: str) -> Path:
    """Where the cache folder has, or will have, the transfer functions of ``digest``."""
    return cache_folder() / f"transfer-{digest[:32]}.npz"


def _from_cache_or_computed(passage: _Passage, progress: Progress) -> TransferFunctions:
    digest = passage.digest
    path = transfer_file(digest)
    bring(path)
    if path.exists():
        try:
            transfer = load(path)
            if transfer.digest == digest:
                with contextlib.suppress(OSError):  # another's file, or a read-only cache
                    os.utime(path, follow_symlinks=False)  # used last: kept longest
                return transfer
            raise InputError(f"{path} holds the transfer functions of something else")
        except InputError as error:
            progress(f"Recomputing a damaged cache file ({error})", 1, 1)
    transfer = _computed(passage, progress)
    if kept(path, lambda: save(transfer, path)):
        share(path)
    keep_newest(path.parent, "transfer-*.npz", LARGEST_CACHE)
    return transfer


def _computed(passage: _Passage, progress: Progress) -> TransferFunctions:
    loads, response, service = passage.loads, passage.response, passage.service
    if loads.bending_share > 0.0:
        straight = replace(passage, loads=replace(loads, bending_share=0.0))
        transfer = _from_cache_or_computed(straight, progress)
        small = response if passage.small_strain is None else passage.small_strain()
        return with_rail_bending(transfer, response, small, loads.bending_share, passage.digest)
    train, speed = service.train, service.speed
    return precompute(train, speed, response, passage.modes, passage.contact, progress, loads.whole)
