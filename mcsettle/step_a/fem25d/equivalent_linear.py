"""Equivalent-linear Step A: the response of the ground softened by one train at one speed."""

from dataclasses import asdict
from pathlib import Path

import numpy as np

from mcsettle.railway.softening_choices import SofteningSettings
from mcsettle.railway.track import SectionTrack, without_laws
from mcsettle.railway.traffic import Train
from mcsettle.step_a.fem25d.cache import FORMAT, digest_of, read_arrays, write_arrays
from mcsettle.step_a.fem25d.moving_load import SectionResponse
from mcsettle.step_a.fem25d.section import MeshSettings
from mcsettle.step_a.fem25d.section_response import section_response
from mcsettle.step_a.fem25d.settings import Settings
from mcsettle.step_a.fem25d.softening import SoftenedGround, SofteningHistory, soften
from mcsettle.step_a.fem25d.track_section import ElementProperties
from mcsettle.storage.files import cache_folder
from mcsettle.types import Progress, silent

HISTORY = ("change", "lowest", "mean", "strain", "damping")


def equivalent_linear_response(
    track: SectionTrack,
    train: Train,
    speed: float,
    integration_depth: float = 5.5,
    settings: Settings | None = None,
    softening: SofteningSettings | None = None,
    cache: Path | None = None,
    progress: Progress = silent,
    workers: int = 1,
    use_cache: bool = True,
    deferred: bool = False,
) -> tuple[SectionResponse, SofteningHistory]:
    """Response of the ground that fits the strains of one train at one speed.

    Parameters
    ----------
    track : SectionTrack
        Track and ground at small strains.
    train, speed
        Whose quasi-static passage at ``speed`` [m/s] softens the ground.
    integration_depth, settings, cache, progress, workers, use_cache, deferred
        As in ``section_response``.
    softening : SofteningSettings, optional
        Strain measure, curves, tolerance.

    Returns
    -------
    (SectionResponse, SofteningHistory)

    Raises
    ------
    ValueError
        For a speed, depth, setting or curve out of range.
    NumericalError
        If the softening does not converge (unless ``softening.keep_last``), or a reduced basis misses
        its tolerance.
    """
    settings = Settings() if settings is None else settings
    ground = softened_ground(
        track, train, speed, integration_depth, settings.mesh, softening, cache, progress, use_cache
    )
    response = section_response(
        track,
        integration_depth,
        settings,
        cache,
        progress,
        workers,
        use_cache,
        ground.properties,
        deferred,
    )
    return response, ground.history


def softened_ground(
    track: SectionTrack,
    train: Train,
    speed: float,
    integration_depth: float,
    mesh: MeshSettings,
    softening: SofteningSettings | None = None,
    cache: Path | None = None,
    progress: Progress = silent,
    use_cache: bool = True,
) -> SoftenedGround:
    """``soften``, computed once and stored on disk; parameters as there and in ``section_response``.

    Only a converged ground is stored.
    """
    softening = SofteningSettings() if softening is None else softening
    folder = cache_folder() if cache is None else Path(cache)
    path = softening_file(track, train, speed, integration_depth, mesh, softening, folder)
    stored = read_arrays(path, "softening", _ground) if use_cache else None
    if stored is not None:
        return stored

    ground = soften(track, train, speed, integration_depth, mesh, softening, progress)
    if use_cache and ground.history.converged:
        write_arrays(path, _arrays(ground))
    return ground


def softening_file(
    track: SectionTrack,
    train: Train,
    speed: float,
    integration_depth: float,
    mesh: MeshSettings,
    softening: SofteningSettings,
    folder: Path,
) -> Path:
    """File in which ``softened_ground`` stores a ground; parameters as there.

    Its name depends on all that a softening depends on: not settlement laws, not vehicle dynamics.
    """
    plain = without_laws(track)
    choices = asdict(softening)
    choices["curves"] = [asdict(curve) for curve in softening.layer_curves(track)]
    key = digest_of(
        {
            "format": FORMAT,
            "track": asdict(plain),
            "axles": train.axle_positions.tolist(),
            "forces": train.axle_forces.tolist(),
            "lengths": [car.length for car in train.cars],
            "speed": float(speed),
            "integration_depth": integration_depth,
            "mesh": asdict(mesh),
            "softening": choices,
        }
    )
    return folder / f"softening-{key[:32]}.npz"


def _arrays(ground: SoftenedGround) -> dict[str, np.ndarray]:
    history = ground.history
    return {
        "scale": ground.properties.scale,
        "element_damping": ground.properties.damping,
        "layers": np.array(history.layers),
        **{name: getattr(history, name) for name in HISTORY},
    }


def _ground(arrays: dict[str, np.ndarray]) -> SoftenedGround:
    history = SofteningHistory(
        layers=tuple(str(name) for name in arrays["layers"]),
        converged=True,
        **{name: arrays[name] for name in HISTORY},
    )
    properties = ElementProperties(arrays["scale"], arrays["element_damping"])
    return SoftenedGround(properties, history)
