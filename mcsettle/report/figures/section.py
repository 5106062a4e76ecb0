"""Cross-section of the track with its mesh, materials and softened moduli (Fig. 7)."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from mcsettle.railway.track import Material, SectionTrack, depth_below_subgrade
from mcsettle.report.figures.style import MAP, note, styled
from mcsettle.step_a.fem25d.section import MeshSettings
from mcsettle.step_a.fem25d.track_section import track_lines
from mcsettle.units import MPA


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


Corners = list[list[tuple[float, float]]]
EDGES: Any = {"edgecolors": "#444444", "linewidths": 0.35}

FILLS = ("#8C8C8C", "#E69F00", "#F0E442", "#9BC7E4", "#66B79B", "#D9A3C0", "#DDDDDD")


@styled
def section_figure(view: SectionView, title: str) -> Figure:
    """Both halves of the section, materials by colour, elements by their edges."""
    figure, axes = _frame(view, title, 7.6)
    corners, picked = _cells(view, view.material >= 0)
    fills = [FILLS[view.material[i, j] % len(FILLS)] for i, j in picked]
    axes.add_collection(PolyCollection(corners, facecolors=fills, **EDGES))
    figure.legend(
        handles=_legend(view),
        loc="outside right upper",
        title="Young's modulus E, Poisson's ratio ν,\ndensity ρ, damping ξ",
    )
    note(
        figure,
        f"The half y ≥ 0 is solved: {view.n_elements} quadratic elements, with an absorbing border "
        "beyond the sides and the bottom (not shown).\nSleepers are smeared along the track: what "
        "counts is these values times their width over their spacing, and hardly any stiffness "
        "along x.",
    )
    return figure


@styled
def softening_figure(view: SectionView, scale: np.ndarray, title: str) -> Figure:
    """Young's modulus of every element under the train over that of its layer, ``scale`` [Ny, Nz]."""
    figure, axes = _frame(view, title, 6.4)
    corners, picked = _cells(view, (view.material >= 0) & np.isfinite(scale))
    values = np.array([scale[i, j] for i, j in picked])
    cells = PolyCollection(corners, cmap=MAP, **EDGES)
    cells.set_array(values)
    cells.set_clim(min(0.5, float(values.min())), 1.0)
    axes.add_collection(cells)
    figure.colorbar(
        cells, ax=axes, label="modulus under the train over modulus at small strain [1]"
    )
    lowest = f"lowest: {values.min():.2f}"
    note(figure, f"Equivalent-linear soil, element by element; sleepers do not soften; {lowest}.")
    return figure


def _frame(view: SectionView, title: str, width: float) -> tuple[Figure, Axes]:
    """A figure ``width`` inches wide with axes in metres and the rails marked."""
    figure = Figure(figsize=(width, 5.6), layout="constrained")
    axes = figure.add_subplot()
    axes.grid(False)
    _rails(axes, view)
    axes.set(xlabel="y across the track [m]", ylabel="z above the subgrade surface [m]")
    axes.set_aspect("equal")
    axes.set_xlim(-view.y[-1] - 0.1, view.y[-1] + 0.1)
    axes.set_ylim(view.z[-1] - 0.1, view.z[0] + 0.45)
    axes.set_title(title)
    return figure, axes


def _cells(view: SectionView, wanted: np.ndarray) -> tuple[Corners, list[tuple[int, int]]]:
    """Corners of the wanted cells on both sides of the centreline, and which cell each one is."""
    corners: Corners = []
    picked: list[tuple[int, int]] = []
    for i, j in np.argwhere(wanted).tolist():
        (a, b), (upper, lower) = view.y[i : i + 2], view.z[j : j + 2]
        for left, right in ((a, b), (-b, -a)):
            corners.append([(left, lower), (right, lower), (right, upper), (left, upper)])
            picked.append((i, j))
    return corners, picked


def _rails(axes: Axes, view: SectionView) -> None:
    """Where the rails stand (they are beams on springs, not part of the mesh)."""
    places = [-view.rail, view.rail]
    axes.plot(places, [view.z[0] + 0.09] * 2, "v", color="k", markersize=8, clip_on=False)
    axes.annotate("rails", (0.0, view.z[0] + 0.04), fontsize=8, ha="center")


def _legend(view: SectionView) -> list[Patch]:
    used = sorted({int(i) for i in np.unique(view.material) if i >= 0})
    return [
        Patch(
            facecolor=FILLS[i % len(FILLS)],
            edgecolor="#444444",
            label=f"{view.names[i]}: {_words(view.materials[i])}",
        )
        for i in used
    ]


def _words(m: Material) -> str:
    return (
        f"E = {m.youngs_modulus / MPA:,.0f} MPa\n"
        f"ν = {m.poisson:g}, ρ = {m.density:,.0f} kg/m³, ξ = {m.damping:g}"
    )
