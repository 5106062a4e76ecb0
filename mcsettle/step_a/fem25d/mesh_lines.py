"""Structured mesh lines of the cross-section: uniform near the track, growing away from it."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
import skfem

from mcsettle.step_a.fem25d.pml import Border, border_lengths

TOLERANCE = 1e-9  # m


@dataclass(frozen=True)
class Lines:
    """Mesh lines along one axis: ``position`` [n + 1] m from the origin and ``stretch`` [n].

    Elements with a stretch other than one belong to the absorbing border; there ``position`` counts
    the modulus of the complex length.
    """

    position: np.ndarray
    stretch: np.ndarray

    @property
    def middle(self) -> np.ndarray:
        """Middle of each element [n] m."""
        return np.asarray((self.position[1:] + self.position[:-1]) / 2.0)

    def cut(self, reach: float) -> float:
        """Position [m] of the first line at least ``reach`` [m] into the border; infinite without."""
        border = np.flatnonzero(self.stretch != 1.0)
        if border.size == 0:
            return math.inf
        beyond = self.position[border[0] :]
        far = beyond[beyond - beyond[0] >= reach]
        return float(far[0]) - TOLERANCE if far.size else math.inf


def uniform_lines(breaks: list[float], size: float) -> np.ndarray:
    """Positions that meet every break, with elements no longer than ``size`` [m]."""
    points = sorted(set(breaks))
    kept = [points[0]] + [b for a, b in itertools.pairwise(points) if b - a > TOLERANCE]
    pieces = [np.array(kept[:1])]
    for a, b in itertools.pairwise(kept):
        n = max(1, math.ceil((b - a) / size - TOLERANCE))
        pieces.append(np.linspace(a, b, n + 1)[1:])
    return np.concatenate(pieces)


def growing_lines(length: float, first: float, growth: float, largest: float) -> np.ndarray:
    """Positions over [0, length] whose elements grow from ``first`` towards ``largest`` [m]."""
    steps = [min(first, length)]
    while sum(steps) < length - TOLERANCE:
        steps.append(min(steps[-1] * growth, max(largest, first)))
    return np.concatenate([[0.0], np.cumsum(steps) * (length / sum(steps))])


def with_border(position: np.ndarray, border: Border) -> Lines:
    """Append an absorbing border to real mesh lines."""
    lengths = border_lengths(float(position[-1] - position[-2]), border)
    beyond = position[-1] + np.cumsum(np.abs(lengths))
    stretch = np.concatenate([np.ones(position.size - 1), lengths / np.abs(lengths)])
    return Lines(np.concatenate([position, beyond]), stretch)


def structured_mesh(y: Lines, depth: Lines, top: float) -> tuple[skfem.MeshQuad, np.ndarray]:
    """Tensor-product mesh in (y, z) with z = ``top`` - depth, and each element's (iy, iz) [2, E]."""
    z = (top - depth.position)[::-1]
    mesh = skfem.MeshQuad.init_tensor(y.position, z)
    return mesh, element_columns(mesh, y, depth, top)


def element_columns(mesh: skfem.MeshQuad, y: Lines, depth: Lines, top: float) -> np.ndarray:
    """Column and row (counted downwards) [2, E] of every element of a mesh on these lines."""
    middle = mesh.p[:, mesh.t].mean(axis=1)
    column = np.searchsorted(y.position, middle[0]) - 1
    row = np.searchsorted(depth.position, top - middle[1]) - 1
    return np.stack([column, row])
