"""A ballasted track as a cross-section: sleeper, embankment, layered ground, border.

The rail is not part of the mesh: a pad spreads its force evenly over the rail foot and follows the mean
displacement under it, so rail and pad join the section in closed form (``moving_load``).
"""

import hashlib
import itertools
import math
from dataclasses import dataclass

import numpy as np

from mcsettle.railway.track import SectionTrack, depth_below_subgrade
from mcsettle.step_a.fem25d.depth_grid import depth_grid
from mcsettle.step_a.fem25d.element import isotropic_stiffness, smeared_stiffness
from mcsettle.step_a.fem25d.mesh_lines import Lines, growing_lines, uniform_lines, with_border
from mcsettle.step_a.fem25d.section import (
    Grid,
    Ground,
    MeshSettings,
    Section,
    build_section,
    damped,
    laid_out,
)

TOLERANCE_BREAK = 1e-6  # m, heights closer than this are one


@dataclass(frozen=True, eq=False)
class ElementProperties:
    """Properties of every element of a track section, E in number, in the order of ``track_grid``.

    ``scale`` [E] is the modulus over that of the layer, ``damping`` [E] the coefficient ξ in the
    track's convention.
    """

    scale: np.ndarray
    damping: np.ndarray

    def __post_init__(self) -> None:
        if self.scale.shape != self.damping.shape or self.scale.ndim != 1:
            raise ValueError(
                f"element properties need two lists of one length, received {self.scale.shape} "
                f"and {self.damping.shape}"
            )
        if not (np.all(self.scale > 0.0) and np.all(np.isfinite(self.scale))):
            raise ValueError("the elements' moduli must be positive and finite")
        if not np.all((self.damping >= 0.0) & (self.damping < 0.5)):
            raise ValueError("the elements' damping must lie in [0, 0.5)")

    @property
    def digest(self) -> str:
        """SHA-256 hex digest of the values."""
        both = np.ascontiguousarray(np.stack([self.scale, self.damping]))
        return hashlib.sha256(both.tobytes()).hexdigest()


def track_section(
    track: SectionTrack,
    integration_depth: float,
    mesh: MeshSettings,
    properties: ElementProperties | None = None,
) -> Section:
    """Half section of a ballasted track: sleeper, embankment, layered ground, border.

    Parameters
    ----------
    track : SectionTrack
        Widths are full widths; the lowest embankment layer rests on the surface z = 0.
    integration_depth : float
        Depth [m] below z = 0 down to which stresses are given and the mesh is real.
    mesh : MeshSettings
        Element sizes and absorbing border.
    properties : ElementProperties, optional
        Moduli and damping element by element; default those of the layers.

    Raises
    ------
    ValueError
        If the number of properties is not that of the elements.
    """
    y, depth = track_lines(track, integration_depth, mesh)
    materials, index = _track_materials(track, y, depth, mesh.axial_ratio)
    grid = depth_grid(track, integration_depth)
    factor = None
    if properties is not None:
        factor = stiffness_factors(track, track_grid(track, integration_depth, mesh), properties)
    return build_section(
        y,
        depth,
        track_top(track),
        materials,
        index,
        rail_foot(track),
        grid.z,
        _layer_bounds(track, integration_depth),
        factor,
    )


def track_grid(track: SectionTrack, integration_depth: float, mesh: MeshSettings) -> Grid:
    """Elements of a track section; material 0 is the sleeper, the layers follow from the top."""
    y, depth = track_lines(track, integration_depth, mesh)
    materials, index = _track_materials(track, y, depth, mesh.axial_ratio)
    return laid_out(y, depth, track_top(track), materials, index)


def track_top(track: SectionTrack) -> float:
    """Height [m] of the top of the sleepers above the subgrade surface."""
    return depth_below_subgrade(track.layers) + track.sleeper.height


def rail_foot(track: SectionTrack) -> tuple[float, float]:
    """Edges [m] of the foot of the rail at y > 0."""
    half = track.rail.foot_width / 2.0
    return track.rail.offset - half, track.rail.offset + half


def stiffness_factors(track: SectionTrack, grid: Grid, properties: ElementProperties) -> np.ndarray:
    """Complex factors [E] that turn the layers' stiffness into that of ``properties``."""
    if properties.scale.shape != (grid.material.size,):
        raise ValueError(
            f"{properties.scale.size} element properties given for {grid.material.size} elements"
        )
    convention = track.damping_convention
    given = damped(1.0, table_damping(track)[grid.material], convention)
    new = damped(1.0, properties.damping, convention)
    return np.asarray(properties.scale * new / given)


def table_damping(track: SectionTrack) -> np.ndarray:
    """Damping coefficient of every material: the sleeper, then the layers."""
    return np.array([track.sleeper.material.damping, *(w.material.damping for w in track.layers)])


def track_lines(
    track: SectionTrack, integration_depth: float, mesh: MeshSettings
) -> tuple[Lines, Lines]:
    """Mesh lines of a track section: y from the centreline, depth from the sleeper top [m]."""
    foot, half = track.rail.foot_width / 2.0, track.rail.offset
    widths = [track.sleeper.length / 2.0] + [w.width / 2.0 for w in track.embankment if w.width]
    breaks = [0.0, half - foot, half + foot, *widths]
    near = uniform_lines(breaks, mesh.size)
    side = growing_lines(mesh.side, mesh.size * mesh.growth, mesh.growth, mesh.largest)
    y = np.concatenate([near, near[-1] + side[1:]])
    heights = np.cumsum([0.0, track.sleeper.height, *(w.height for w in track.embankment)])
    upper = uniform_lines([float(h) for h in heights], mesh.size)
    lower = _ground_lines(track, integration_depth, mesh)
    depth = np.concatenate([upper, upper[-1] + lower[1:]])
    return with_border(y, mesh.border), with_border(depth, mesh.border)


def _ground_lines(track: SectionTrack, integration_depth: float, mesh: MeshSettings) -> np.ndarray:
    """Lines from z = 0 down past every interface and the integration depth [m]."""
    interfaces = list(np.cumsum([w.height for w in track.ground[:-1]]))
    breaks = sorted({0.0, integration_depth, *(float(i) for i in interfaces)})
    position, first = np.array([0.0]), mesh.size
    for a, b in itertools.pairwise(breaks):
        if b - a < TOLERANCE_BREAK:
            continue
        piece = growing_lines(b - a, first, mesh.growth, mesh.largest)
        first = min((piece[-1] - piece[-2]) * mesh.growth, mesh.largest)
        position = np.concatenate([position, position[-1] + piece[1:]])
    return position


def _track_materials(
    track: SectionTrack, y: Lines, depth: Lines, axial_ratio: float
) -> tuple[list[Ground], np.ndarray]:
    """Material list (sleeper first, then the layers) and its index for every cell."""
    convention = track.damping_convention
    m, s = track.sleeper.material, track.sleeper
    modulus = damped(m.youngs_modulus, m.damping, convention)
    materials = [
        Ground(smeared_stiffness(modulus, m.poisson, s.fill, axial_ratio), m.density * s.fill)
    ]
    for layer in track.layers:
        m = layer.material
        modulus = damped(m.youngs_modulus, m.damping, convention)
        materials.append(Ground(isotropic_stiffness(modulus, m.poisson), m.density))
    bottoms = np.cumsum([s.height, *(w.height for w in track.layers)])
    row = np.searchsorted(bottoms, depth.middle)
    widths = [s.length] + [math.inf if w.width is None else w.width for w in track.layers]
    inside = np.abs(y.middle)[:, None] < np.array(widths)[row][None, :] / 2.0
    return materials, np.where(inside, row[None, :], -1)


def _layer_bounds(track: SectionTrack, integration_depth: float) -> list[tuple[float, float]]:
    """Upper and lower height [m] of every layer in which stresses are given."""
    z, bounds = depth_below_subgrade(track.layers), []
    for layer in track.layers:
        lower = max(z - layer.height, -integration_depth)
        if lower < z - TOLERANCE_BREAK:
            bounds.append((z, lower))
        z = lower
    return bounds
