"""Quadrature over the depth of the layers, and the geostatic stress at its points.

Settlement is an integral over depth, layer by layer, since laws and moduli jump at the interfaces.
Each layer is divided into panels with Gauss–Legendre points; the track model chooses the panels.
"""

from collections.abc import Callable

import numpy as np

from mcsettle.railway.track import Layer, depth_below_subgrade
from mcsettle.step_a.transfer import DepthGrid
from mcsettle.units import GRAVITY

# Upper and lower height [m] of one layer -> middles and half heights [P] m of its panels, downwards.
Panels = Callable[[Layer, float, float], tuple[np.ndarray, np.ndarray]]
THINNEST = 1e-9  # m: what is left of a layer above the integration depth may be rounding


def layer_quadrature(
    layers: tuple[Layer, ...], integration_depth: float, panels: Panels, points: int
) -> DepthGrid:
    """Composite Gauss–Legendre points from the sleeper base to the integration depth.

    Parameters
    ----------
    layers : tuple of Layer
        From the sleeper base down.
    integration_depth : float
        Depth [m] below the subgrade surface.
    panels : callable
        Divides a layer: (layer, upper, lower [m]) to middles and half heights [P] m.
    points : int
        Gauss points per panel.
    """
    nodes, node_weights = np.polynomial.legendre.leggauss(points)
    z, weights, index = [], [], []
    upper = depth_below_subgrade(layers)
    for number, layer in enumerate(layers):
        lower = max(upper - layer.height, -integration_depth)
        if upper - lower <= THINNEST:
            continue
        middle, half = panels(layer, upper, lower)
        z.append((middle[:, None] - half[:, None] * nodes).ravel())
        weights.append((half[:, None] * node_weights).ravel())
        index.append(np.full(z[-1].size, number))
        upper = lower
    return DepthGrid(np.concatenate(z), np.concatenate(weights), np.concatenate(index))


def geostatic_stress(layers: tuple[Layer, ...], grid: DepthGrid) -> np.ndarray:
    """Geostatic stress [4, Z] Pa, σzz = -Σ ρ g h of the layers above and σxx = σyy = K0 σzz.

    Compression is negative, the shear stress zero. The weight of sleepers and rails (about 2 kPa under
    the case studies' sleepers) is left out, as in the paper; the embankment counts as infinitely wide.
    """
    vertical = np.zeros(grid.z.size)
    upper = depth_below_subgrade(layers)
    for layer in layers:
        lower = upper - layer.height
        thickness = np.clip(upper - np.maximum(grid.z, lower), 0.0, None)
        vertical -= layer.material.density * GRAVITY * thickness
        upper = lower
    k0 = np.array([layer.k0 for layer in layers])[grid.layer]
    return np.stack([k0 * vertical, k0 * vertical, vertical, np.zeros(grid.z.size)])
