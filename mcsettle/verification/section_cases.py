"""Verification of the 2.5D section: a strip load on layered ground against the exact solution.

The section has no track here, only the loaded strip; elements and border are those of the
production mesh. Errors are relative to the largest stress over depth and component.
"""

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from mcsettle.railway.track import LEAN_CLAY, VALIDATION_TRACK, Layer
from mcsettle.step_a.fem25d.element import isotropic_stiffness
from mcsettle.step_a.fem25d.mesh_lines import growing_lines, uniform_lines, with_border
from mcsettle.step_a.fem25d.section import Ground, MeshSettings, Section, build_section, damped
from mcsettle.step_a.fem25d.solve import factorise, outputs, solve
from mcsettle.verification.case import Case, worst_point
from mcsettle.verification.layered_ground import layered_ground
from mcsettle.verification.strip import strip_compliance, strip_response

WIDTH = 2.5  # m
DEPTHS = np.array([0.06, 0.25, 0.45, 0.6, 1.0, 2.0, 3.5, 5.3])  # m
PRODUCTION = MeshSettings()
REAL_DEPTH = 5.5  # m, to which the mesh is real
SPEED = 56.0  # m/s, the case studies' fastest train
STATIC = [(k, 0.0) for k in (0.01, 0.1, 0.5, 1.0, 3.0)]
MOVING = [(k, k * SPEED) for k in (0.01, 0.1, 0.5, 1.0, 3.0)]
HARMONIC = [(k, w) for w in (20.0, 60.0, 160.0) for k in (0.005, 0.1, 0.5)]


def ground_section(
    layers: tuple[Layer, ...], depths: np.ndarray = DEPTHS, mesh: MeshSettings = PRODUCTION
) -> Section:
    """Half section of layered ground alone, loaded on |y| < ``WIDTH``/2 with 1 N per half.

    Parameters
    ----------
    layers
        Ground layers from the surface down, the last a half-space.
    depths
        [D] m below the surface, less than ``REAL_DEPTH``, none on an interface.
    mesh
        Element sizes and border; the production mesh by default.

    Raises
    ------
    ValueError
        If a depth lies on an interface or below the real mesh.
    """
    near = uniform_lines([0.0, WIDTH / 2.0, WIDTH / 2.0 + 0.5], mesh.size)
    side = growing_lines(mesh.side, mesh.size * mesh.growth, mesh.growth, mesh.largest)
    y = with_border(np.concatenate([near, near[-1] + side[1:]]), mesh.border)
    interfaces = np.cumsum([layer.height for layer in layers[:-1]])
    breaks = [0.0, *interfaces.tolist(), REAL_DEPTH]
    if np.any(np.isin(depths, breaks)) or np.any(depths > REAL_DEPTH):
        raise ValueError(f"depths are {depths} m; they must lie between {breaks} m")
    depth = with_border(_graded(breaks, mesh), mesh.border)
    row = np.searchsorted(interfaces, depth.middle)
    return build_section(
        y,
        depth,
        0.0,
        [_material(layer) for layer in layers],
        np.tile(row, (y.middle.size, 1)),
        (0.0, WIDTH / 2.0),
        -np.asarray(depths),
        [(-upper, -lower) for upper, lower in zip(breaks, breaks[1:], strict=False)],
    )


def section_and_exact(
    section: Section, layers: tuple[Layer, ...], points: list[tuple[float, float]]
) -> tuple[np.ndarray, np.ndarray]:
    """Mean displacement and stresses, per N/m on the complete strip, by the section and exactly.

    Returns
    -------
    Two arrays [points, 1 + 4 D] for (k, ω) in ``points``, on the strip and depths of this module.
    """
    ground = layered_ground(layers)
    obtained, exact = [], []
    for k, omega in points:
        obtained.append(outputs(section, k, solve(section, k, omega)) / 2.0)
        strip = strip_response(ground, k, omega, WIDTH, DEPTHS)
        exact.append(np.concatenate([[strip.mean], strip.stress.ravel()]))
    return np.array(obtained), np.array(exact)


def _graded(breaks: list[float], mesh: MeshSettings) -> np.ndarray:
    """Lines over the breaks, growing downwards through them."""
    position, first = np.array([0.0]), mesh.size
    for upper, lower in zip(breaks, breaks[1:], strict=False):
        piece = growing_lines(lower - upper, first, mesh.growth, mesh.largest)
        first = min(float(piece[-1] - piece[-2]) * mesh.growth, mesh.largest)
        position = np.concatenate([position, position[-1] + piece[1:]])
    return position


def _material(layer: Layer) -> Ground:
    m = layer.material
    modulus = damped(m.youngs_modulus, m.damping, "damping_ratio")
    return Ground(isotropic_stiffness(modulus, m.poisson), m.density)


_section = cache(ground_section)


def _compare(
    layers: tuple[Layer, ...], points: list[tuple[float, float]], what: str, tolerance: float
) -> Callable[[str], Case]:
    """Case of the worst relative error over ``points``, of the displacement or the stresses."""

    def case(name: str) -> Case:
        obtained, exact = section_and_exact(_section(layers), layers, points)
        part = slice(0, 1) if what == "displacement" else slice(1, None)
        obtained, exact = obtained[:, part], exact[:, part]
        scale = np.abs(exact).max(axis=1)
        at = int(np.argmax(np.abs(obtained - exact).max(axis=1) / scale))
        unit = "m/(N/m)" if what == "displacement" else "Pa/(N/m)"
        source = f"layered ground, exact, {len(points)} points (k, ω)"
        return worst_point(name, source, exact[at], obtained[at], tolerance, unit)

    return case


def section_reciprocity(name: str) -> Case:
    """Displacement ux at one node for a vertical force at another, against uz there for a force along x.

    With u = (i ũx, uy, uz) the two are equal, damping and border included.
    """
    section = _section(VALIDATION_TRACK.ground)
    lu = factorise(section, 0.4, 50.0)
    loaded = int(np.argmax(np.abs(section.load)))
    others = np.linspace(0, section.unknowns - 1, 41, dtype=int)
    unit = np.zeros((section.unknowns, 1 + others.size), dtype=complex)
    unit[loaded, 0] = 1.0
    unit[others, np.arange(1, 1 + others.size)] = 1.0
    u = lu.solve(unit)
    source = "Betti: symmetric response"
    return worst_point(name, source, u[others, 0], u[loaded, 1:], 1e-9, "m/(N/m)")


def moving_deflection(name: str) -> Case:
    """Rails on the strip under a constant load at 56 m/s: section and exact ground.

    ũ = 1/(EI k⁴ - m ω² + 1/ũ_ground) integrated over k at fixed Gauss points, same for both.
    """
    layers = VALIDATION_TRACK.ground
    edges = np.array([0.0, 0.01, 0.05, 0.2, 0.5, 1.0, 1.8, 3.0, 5.0])
    nodes, weights = np.polynomial.legendre.leggauss(4)
    half = np.diff(edges)[:, None] / 2.0
    k = (edges[:-1, None] + half * (1.0 + nodes)).ravel()
    section, ground = _section(layers), layered_ground(layers)
    obtained, exact = np.empty((2, k.size), dtype=complex)
    for i, q in enumerate(k.tolist()):
        obtained[i] = section.load @ solve(section, q, q * SPEED) / 2.0
        exact[i] = strip_compliance(ground, q, q * SPEED, WIDTH)
    rail = VALIDATION_TRACK.rail
    beam = 2.0 * (rail.bending_stiffness * k**4 - rail.mass_per_length * (k * SPEED) ** 2)
    s = np.linspace(-6.0, 6.0, 25)
    waves = np.exp(-1j * np.outer(s, k)) * (half * weights).ravel() / math.pi
    deflection = [(waves @ (1.0 / (beam + 1.0 / values))).real for values in (exact, obtained)]
    source = "beam on layered ground, moving load"
    return worst_point(name, source, deflection[0], deflection[1], 1e-3, "m/N")


_CLAY, _LAYERED = (LEAN_CLAY,), VALIDATION_TRACK.ground
# Measured: 7e-4 to 1.4e-3 for the displacement; stresses 1e-3 to 2.4e-3 with elements of 0.15 m
SECTION_CASES: dict[str, Callable[[str], Case]] = {
    "section_static_displacement": _compare(_LAYERED, STATIC, "displacement", 1e-3),
    "section_static_stress": _compare(_LAYERED, STATIC, "stress", 2e-3),
    "section_moving_displacement": _compare(_LAYERED, MOVING, "displacement", 1.5e-3),
    "section_moving_stress": _compare(_LAYERED, MOVING, "stress", 1.5e-3),
    "section_harmonic_displacement": _compare(_LAYERED, HARMONIC, "displacement", 4e-3),
    "section_harmonic_stress": _compare(_LAYERED, HARMONIC, "stress", 4e-3),
    "section_clay_moving_stress": _compare(_CLAY, MOVING, "stress", 3e-3),
    "section_clay_harmonic_stress": _compare(_CLAY, HARMONIC, "stress", 4e-3),
    "section_moving_deflection": moving_deflection,
    "section_reciprocity": section_reciprocity,
}
