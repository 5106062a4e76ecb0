"""Depths of the outputs on the centreline, and the geostatic stress there."""

import math

import numpy as np

from mcsettle.railway.track import SectionTrack, depth_below_subgrade
from mcsettle.step_a.transfer import DepthGrid
from mcsettle.units import GRAVITY

FIRST_PANEL = 0.8  # m, uppermost Gauss panel of the ground; each further one doubles
POINTS = 3  # Gauss points a panel
TALL = 0.4  # m, an embankment layer taller than this is two panels


def depth_grid(track: SectionTrack, integration_depth: float) -> DepthGrid:
    """Composite Gauss–Legendre depths through the embankment and the ground.

    An embankment layer is one panel (two beyond 0.4 m); in the ground, panels double in height with
    depth, because σ_d² falls off with it.

    Parameters
    ----------
    track : SectionTrack
        Layers from the sleeper base down.
    integration_depth : float
        Depth below the subgrade surface [m].

    Raises
    ------
    ValueError
        If the depth is not positive and finite.
    """
    if not 0.0 < integration_depth < math.inf:
        raise ValueError(
            f"integration depth is {integration_depth} m; it must be positive and finite"
        )
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    z, w, index = [], [], []
    upper = depth_below_subgrade(track.layers)
    for i, layer in enumerate(track.layers):
        lower = max(upper - layer.height, -integration_depth)
        for a, b in _panels(upper, lower, layer.width is None):
            z.append((a + b) / 2.0 - nodes * (a - b) / 2.0)
            w.append(weights * (a - b) / 2.0)
            index.append(np.full(POINTS, i))
        upper = lower
    return DepthGrid(np.concatenate(z), np.concatenate(w), np.concatenate(index))


def _panels(upper: float, lower: float, ground: bool) -> list[tuple[float, float]]:
    """Panels (upper, lower) that fill one layer."""
    height = upper - lower
    if height <= 1e-9:
        return []
    if not ground:
        edges = np.linspace(upper, lower, 3 if height > TALL else 2)
    else:
        count = max(1, math.ceil(math.log2(height / FIRST_PANEL + 1.0) - 1e-9))
        share = (2.0 ** np.arange(count + 1) - 1.0) / (2.0**count - 1.0)
        edges = np.asarray(upper - height * share, dtype=np.float64)
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))


def geostatic_stress(track: SectionTrack, grid: DepthGrid) -> np.ndarray:
    """Geostatic stress [4, Z] Pa from the unit weights above and K0; compression is negative.

    The weight of sleepers and rails (about 2 kPa under the case studies' sleepers) is left out, as
    the paper speaks of the layers alone; the embankment counts as if it were wide.
    """
    vertical = np.zeros(grid.z.size)
    upper = depth_below_subgrade(track.layers)
    for layer in track.layers:
        lower = upper - layer.height
        thickness = np.clip(upper - np.maximum(grid.z, lower), 0.0, None)
        vertical -= layer.material.density * GRAVITY * thickness
        upper = lower
    k0 = np.array([layer.k0 for layer in track.layers])[grid.layer]
    return np.stack([k0 * vertical, k0 * vertical, vertical, np.zeros(grid.z.size)])
