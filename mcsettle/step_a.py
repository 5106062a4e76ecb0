"""Step A of a study: one set of transfer functions for every distinct track, train and speed.

What was computed once is kept in the cache folder under the digest of everything it depends on, so a
change of Step B or of the economics costs nothing here.

Depends on: beam, errors, fem25d, interaction, irregularity, study, track, traffic, transfer_file.
"""

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcsettle.beam import beam_response
from mcsettle.errors import InputError
from mcsettle.interaction import HERTZ_STIFFNESS, precompute, transfer_digest
from mcsettle.irregularity import wavenumbers
from mcsettle.study import Study
from mcsettle.track import BeamTrack, Track
from mcsettle.traffic import Service
from mcsettle.transfer import TrackResponse, TransferFunctions
from mcsettle.transfer_file import load, save

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class StepA:
    """Transfer functions of a study by (variant, scenario): one per service, in timetable order."""

    transfers: dict[tuple[str, str], tuple[TransferFunctions, ...]]

    @property
    def digest(self) -> str:
        """SHA-256 [hex] over all transfer functions."""
        digests = sorted({t.digest for group in self.transfers.values() for t in group})
        return hashlib.sha256("\n".join(digests).encode()).hexdigest()


def cache_folder() -> Path:
    """Folder of precomputed results: ``MCSETTLE_CACHE`` or the user's cache; made if missing.

    Raises
    ------
    InputError
        The folder cannot be made.
    """
    base = os.environ.get("MCSETTLE_CACHE") or os.environ.get("XDG_CACHE_HOME")
    folder = Path(base) if base else Path.home() / ".cache"
    if not os.environ.get("MCSETTLE_CACHE"):
        folder = folder / "mcsettle"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the cache folder {folder} cannot be made ({error.strerror}); "
            "set MCSETTLE_CACHE to a folder that can be written"
        ) from None
    return folder


def study_wavenumbers(study: Study) -> np.ndarray:
    """Wavenumbers [K] rad/m of the profile modes of a study."""
    profile = study.profile
    return wavenumbers(profile.window_m, profile.shortest_m, profile.longest_m)


def track_response(
    track: Track,
    integration_depth: float,
    progress: Progress | None = None,
    workers: int = 1,
) -> TrackResponse:
    """Step A's track model for ``track``, stresses down to ``integration_depth`` [m] below z = 0.

    ``workers`` > 1 spawns processes, so the calling program needs a main guard.
    """
    if isinstance(track, BeamTrack):
        return beam_response(track, integration_depth)
    from mcsettle.fem25d import section_response

    return section_response(
        track,
        integration_depth,
        cache=cache_folder(),
        progress=_reversed(progress),
        workers=workers,
    )


def step_a(study: Study, progress: Progress | None = None, workers: int = 1) -> StepA:
    """Transfer functions of every variant and scenario, computed once where equal, kept on disk."""
    modes = study_wavenumbers(study)
    responses: dict[tuple[Track, float], TrackResponse] = {}
    found: dict[tuple[Track, float, Service], TransferFunctions] = {}
    transfers = {}
    for variant in study.variant_names:
        track = study.track(variant)
        depth = study.settlement_settings(variant).integration_depth_m
        for scenario in study.scenario_names:
            group = []
            for service in study.timetable(scenario).services:
                key = (track, depth, Service(service.train, service.speed, 1))
                if key not in found:
                    if (track, depth) not in responses:
                        responses[track, depth] = track_response(track, depth, progress, workers)
                    found[key] = _transfer(responses[track, depth], service, modes, progress)
                group.append(found[key])
            transfers[variant, scenario] = tuple(group)
    return StepA(transfers)


def _transfer(
    response: TrackResponse, service: Service, modes: np.ndarray, progress: Progress | None
) -> TransferFunctions:
    """One set of transfer functions, from the cache if it is there and sound."""
    digest = transfer_digest(service.train, service.speed, modes, HERTZ_STIFFNESS, response.digest)
    path = cache_folder() / f"transfer-{digest[:32]}.npz"
    if path.exists():
        try:
            return load(path)
        except InputError as error:
            if progress is not None:
                progress(f"Recomputing a damaged cache file ({error})", 1, 1)
    text = f"Step A: {service.train.name} at {service.speed * 3.6:.0f} km/h"
    steps = None if progress is None else lambda done, total: progress(text, done, total)
    transfer = precompute(service.train, service.speed, response, modes, progress=steps)
    save(transfer, path)
    return transfer


def _reversed(progress: Progress | None) -> Callable[[int, int, str], None] | None:
    return None if progress is None else lambda done, total, text: progress(text, done, total)
