"""One set of transfer functions: from the cache folder if it is valid there, else computed and kept."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.traffic import Service, Train
from mcsettle.step_a.interaction import precompute, transfer_digest
from mcsettle.step_a.transfer import TrackResponse, TransferFunctions
from mcsettle.step_a.transfer_file import keep_newest, load, save
from mcsettle.storage.files import cache_folder
from mcsettle.storage.shared_cache import bring, share
from mcsettle.types import Progress

# Bytes of transfer functions kept: drawn vehicles leave one file per parameter set.
LARGEST_CACHE = 4_000_000_000


def cached_transfer(
    response: TrackResponse,
    service: Service,
    modes: np.ndarray,
    contact: float,
    progress: Progress | None = None,
    axle_loads: dict[str, float] | None = None,
) -> TransferFunctions:
    """Transfer functions of one service on ``response``.

    ``modes`` [K] rad/m; ``contact``: Hertzian stiffness N/m. A train that differs from its axle load
    [kg] in ``axle_loads`` alone has the same dynamic response and a quasi-static one in proportion, so
    it is scaled, not computed.
    """
    train = service.train
    reference = under_reference_load(train, axle_loads or {})
    if reference is None:
        return _from_cache_or_computed(response, service, modes, contact, progress)
    base = replace(service, train=reference)
    transfer = _from_cache_or_computed(response, base, modes, contact, progress)
    ratio = train.cars[0].axle_load / reference.cars[0].axle_load
    digest = transfer_digest(train, service.speed, modes, contact, response.digest)
    return scaled_to(transfer, ratio, digest)


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


def _from_cache_or_computed(
    response: TrackResponse,
    service: Service,
    modes: np.ndarray,
    contact: float,
    progress: Progress | None,
) -> TransferFunctions:
    digest = transfer_digest(service.train, service.speed, modes, contact, response.digest)
    path = transfer_file(digest)
    bring(path)
    if path.exists():
        try:
            transfer = load(path)
            if transfer.digest == digest:
                path.touch()  # used last: kept longest
                return transfer
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
