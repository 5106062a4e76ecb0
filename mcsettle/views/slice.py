"""Deflection of the track and ground along the centreline under a moving train (Fig. 10).

The reduced bases of Step A know the rail and the stresses, not the displacement of the ground. The
slice is therefore solved directly, at some sixty wavenumbers on the line ω = k v, between which
the displacement is a smooth function of log k. It is the quasi-static part: the dynamic part would
need a solution for every driving frequency too.

Depends on: fem25d, traffic.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from mcsettle.fem25d import SectionResponse
from mcsettle.fem25d.moving import rail_coupling
from mcsettle.fem25d.section import Section, track_section
from mcsettle.fem25d.solve import solve
from mcsettle.traffic import Train

REACH = 20.0  # m shown beyond the ends of the train
STEP = 0.2  # m between places along the track
SHORTEST = 1e-5  # rad/m, just below the first node of the quadrature: a wave of 600 km
VERTICAL = 2  # component of the displacement


@dataclass(frozen=True)
class DeflectionSlice:
    """Quasi-static deflection [X, D] m, positive down, at ``x`` [X] m and heights ``z`` [D] m.

    ``x`` from the train's middle, positive forward; ``rail`` [X] m its deflection, ``axles`` [J] m.
    """

    label: str
    x: np.ndarray
    z: np.ndarray
    deflection: np.ndarray
    rail: np.ndarray
    axles: np.ndarray


def deflection_slice(response: SectionResponse, train: Train, speed: float) -> DeflectionSlice:
    """The slice y = 0 for ``train`` at ``speed`` [m/s], from the rail down to the real mesh's end."""
    section = track_section(
        response.track, response.integration_depth, response.settings.mesh, response.properties
    )
    unknowns, z = _centreline(section, -response.integration_depth)
    samples = _samples(response.settings.bands[-1])
    found = np.array([_per_load(response, section, unknowns, k, k * speed) for k in samples])
    k, weights = response.quadrature.nodes, response.quadrature.weights
    spectrum = CubicSpline(np.log(samples), found)(np.log(k))
    positions, forces = train.axle_positions, train.axle_forces
    middle = float(positions[0] + positions[-1]) / 2.0
    half = float(positions[0] - positions[-1]) / 2.0 + REACH
    x = np.linspace(-half, half, 2 * math.ceil(half / STEP) + 1)
    load = (forces @ np.exp(1j * np.outer(positions, k))) * weights / math.pi
    waves = np.exp(-1j * np.outer(x + middle, k))
    field = (waves @ (spectrum * load[:, None])).real
    label = f"{train.name}, {speed * 3.6:.0f} km/h"
    return DeflectionSlice(label, x, z, field[:, 1:], field[:, 0], positions - middle)


def _samples(cutoff: float) -> np.ndarray:
    """Wavenumbers at which the section is solved [rad/m]: dense where the response bends."""
    parts = [np.geomspace(SHORTEST, 0.05, 16), np.linspace(0.05, 3.0, 40)[1:]]
    return np.concatenate([*parts, np.geomspace(3.0, cutoff, 9)[1:]])


def _centreline(section: Section, lowest: float) -> tuple[np.ndarray, np.ndarray]:
    """Free unknowns of the vertical displacement on y = 0, from the top down, and their heights."""
    basis = section.basis
    vertical = np.zeros(basis.N, dtype=bool)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        vertical[dofs[VERTICAL]] = True
    y, z = basis.doflocs[:, section.free]
    at = np.flatnonzero(vertical[section.free] & (np.abs(y) < 1e-9) & (z >= lowest - 1e-9))
    order = at[np.argsort(-z[at])]
    return order, z[order]


def _per_load(
    response: SectionResponse, section: Section, unknowns: np.ndarray, k: float, omega: float
) -> np.ndarray:
    """Downward displacement of rail and centreline [1 + D] for a unit load per wheelset, ω ≥ 0."""
    u = solve(section, k, omega)
    foot = np.array([section.load @ u])
    rail, pad = rail_coupling(response.track, np.array([k]), np.array([omega]), foot)
    return np.concatenate([rail, -u[unknowns] * pad[0]])
