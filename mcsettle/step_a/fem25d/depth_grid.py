"""Depths of the stresses that a cross-section gives on the centreline."""

import math

import numpy as np

from mcsettle.errors import check_positive
from mcsettle.railway.track import Layer, SectionTrack
from mcsettle.step_a.depths import layer_quadrature
from mcsettle.step_a.transfer import DepthGrid

FIRST_PANEL = 0.8  # m, uppermost Gauss panel of the ground; each further one doubles
POINTS = 3  # Gauss points per panel
TALL = 0.4  # m, an embankment layer taller than this is two panels


def depth_grid(track: SectionTrack, integration_depth: float) -> DepthGrid:
    """Composite Gauss–Legendre depths through the embankment and the ground.

    An embankment layer is one panel (two beyond 0.4 m); in the ground, panels double in height with
    depth, because σ_d² decreases with it.

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
    check_positive("integration depth", integration_depth, "m")
    return layer_quadrature(track.layers, integration_depth, _panels, POINTS)


def _panels(layer: Layer, upper: float, lower: float) -> tuple[np.ndarray, np.ndarray]:
    """Middles and half heights [P] m of the panels of one layer."""
    height = upper - lower
    if layer.width is not None:
        edges = np.linspace(upper, lower, 3 if height > TALL else 2)
    else:
        # Heights h, 2h, 4h, … that fill the layer, with h at most FIRST_PANEL.
        count = max(1, math.ceil(math.log2(height / FIRST_PANEL + 1.0) - 1e-9))
        share = (2.0 ** np.arange(count + 1) - 1.0) / (2.0**count - 1.0)
        edges = np.asarray(upper - height * share, dtype=np.float64)
    return (edges[:-1] + edges[1:]) / 2.0, (edges[:-1] - edges[1:]) / 2.0
