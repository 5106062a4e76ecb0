"""Mesh and materials of a section track as plain arrays, symmetric half.

Depends on: fem25d, track.
"""

import math
from dataclasses import dataclass

import numpy as np

from mcsettle.fem25d.section import MeshSettings
from mcsettle.fem25d.track_section import track_lines
from mcsettle.track import Material, SectionTrack, depth_below_subgrade


@dataclass(frozen=True)
class SectionView:
    """Real part of the half section: mesh lines and what fills each cell.

    ``y`` [Ny + 1] m from the centreline, ``z`` [Nz + 1] m falling; ``material`` [Ny, Nz] index into
    ``names`` and ``materials`` (-1: outside the track); ``n_elements`` of the whole half mesh with
    its absorbing border; ``rail`` m, half the gauge between the rails' centres.
    """

    y: np.ndarray
    z: np.ndarray
    material: np.ndarray
    names: tuple[str, ...]
    materials: tuple[Material, ...]
    n_elements: int
    rail: float


def section_view(
    track: SectionTrack, integration_depth: float, mesh: MeshSettings | None = None
) -> SectionView:
    """The mesh the solver uses for ``track``, cut where the absorbing border begins."""
    y, depth = track_lines(track, integration_depth, mesh or MeshSettings())
    top = depth_below_subgrade(track.layers) + track.sleeper.height
    bottoms = np.cumsum([track.sleeper.height, *(layer.height for layer in track.layers)])
    row = np.searchsorted(bottoms, depth.middle)
    widths = np.array(
        [track.sleeper.length]
        + [math.inf if layer.width is None else layer.width for layer in track.layers]
    )
    inside = y.middle[:, None] < widths[row][None, :] / 2.0
    material = np.where(inside, row[None, :], -1)
    columns, rows = int(np.sum(y.stretch == 1.0)), int(np.sum(depth.stretch == 1.0))
    return SectionView(
        y=np.abs(y.position[: columns + 1]),
        z=top - np.abs(depth.position[: rows + 1]),
        material=material[:columns, :rows],
        names=("sleeper", *(layer.name.replace("_", "-") for layer in track.layers)),
        materials=(track.sleeper.material, *(layer.material for layer in track.layers)),
        n_elements=int(np.sum(material >= 0)),
        rail=track.rail.offset,
    )


def cell_values(view: SectionView, place: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values [E] of elements at ``place`` [2, E] (column, row) as an array over the view's cells.

    Cells outside the track are NaN; elements of the absorbing border are left out.
    """
    cells = np.full(view.material.shape, np.nan)
    column, row = place
    columns, rows = view.y.size - 1, view.z.size - 1
    shown = (column < columns) & (row < rows)
    cells[column[shown], row[shown]] = values[shown]
    return cells
