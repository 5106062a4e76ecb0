"""The track model that answers for a track: closed-form beam, or section, linear or softened."""

from typing import TYPE_CHECKING

from mcsettle.railway.softening_choices import Softened
from mcsettle.railway.track import BeamTrack, SectionTrack, Track
from mcsettle.step_a import beam
from mcsettle.step_a.beam import beam_response
from mcsettle.step_a.transfer import DepthGrid, TrackResponse
from mcsettle.storage.files import cache_folder

if TYPE_CHECKING:
    from mcsettle.step_a.fem25d import Settings, SofteningHistory
from mcsettle.types import Progress, silent


def softening_history(
    track: SectionTrack, integration_depth: float, softened: Softened
) -> "SofteningHistory":
    """How the softening under one service went (from disk where it was computed before).

    Raises
    ------
    NumericalError
        If it does not converge.
    """
    from mcsettle.step_a.fem25d.equivalent_linear import softened_ground
    from mcsettle.step_a.fem25d.settings import Settings

    return softened_ground(
        track,
        softened.train,
        softened.speed,
        integration_depth,
        Settings().mesh,
        softened.settings,
        cache_folder(),
    ).history


def depths_of(track: Track, integration_depth: float) -> DepthGrid:
    """Depths at which the response of ``track`` gives stresses, without the response."""
    if isinstance(track, BeamTrack):
        return beam.depth_grid(track.layers, integration_depth)
    from mcsettle.step_a.fem25d.depth_grid import depth_grid

    return depth_grid(track, integration_depth)


def track_response(
    track: Track,
    integration_depth: float,
    progress: Progress = silent,
    workers: int = 1,
    softened: "Softened | None" = None,
    settings: "Settings | None" = None,
) -> TrackResponse:
    """Step A's track model for ``track``, stresses down to ``integration_depth`` [m] below z = 0.

    The bases of a section are read, or computed, when they are first asked for. With ``softened`` the
    ground takes the moduli that fit the strains of that train at that speed (equivalent-linear soil).
    ``workers`` > 1 spawns processes, so the calling program needs a main guard.

    Raises
    ------
    NumericalError
        If the softening does not converge.
    """
    if isinstance(track, BeamTrack):
        return beam_response(track, integration_depth)
    from mcsettle.step_a.fem25d import equivalent_linear_response, section_response

    if softened is not None:
        return equivalent_linear_response(
            track,
            softened.train,
            softened.speed,
            integration_depth,
            settings,
            softening=softened.settings,
            cache=cache_folder(),
            progress=progress,
            workers=workers,
            deferred=True,
        )[0]
    return section_response(
        track,
        integration_depth,
        settings,
        cache=cache_folder(),
        progress=progress,
        workers=workers,
        deferred=True,
    )
