"""How much the results of Step A change when its numerical choices are refined.

Every choice (mesh, border, depth of the real mesh, wavenumbers, tolerance of the bases) is varied
separately, the others at their defaults; each level is compared with the finest one of its choice. The
results are the inputs of Step B, for a unit load at 60 m/s: rail deflection under a constant
load, vertical stress in every layer below it, and the track compliance at two driving frequencies.

Mesh, border and wavenumbers are compared by direct solutions (spectra at a few wavenumbers,
polynomials between them); quadrature and tolerance by the reduced bases themselves. The results
of each level are stored in the cache folder: a study resumes where it stopped, one choice at a time
if need be.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from mcsettle.railway.track import CASE_STUDY_TRACK, SectionTrack, without_laws
from mcsettle.step_a.fem25d import MeshSettings, Settings, section_response
from mcsettle.step_a.fem25d.cache import FORMAT, digest_of, read_arrays, write_arrays
from mcsettle.step_a.fem25d.depth_grid import depth_grid
from mcsettle.step_a.fem25d.line_spectra import rail_coupling
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.solve import outputs, solve
from mcsettle.step_a.fem25d.track_section import track_section
from mcsettle.step_a.fem25d.wavenumber_rule import wavenumber_quadrature
from mcsettle.storage.files import cache_folder
from mcsettle.types import Progress, silent

SPEED = 60.0  # m/s
OMEGAS = (2.0 * math.pi * SPEED / 25.0, 2.0 * math.pi * SPEED / 5.0)  # waves of 25 and 5 m
DEPTH = 5.5  # m
SHIFT = 0.06  # rad/m: wavenumbers are spread evenly in log(k + SHIFT)


@dataclass(frozen=True)
class Numerics:
    """Choices of one computation; ``largest`` [rad/m] ends the wavenumbers, ``count`` of them."""

    mesh: MeshSettings = MeshSettings()
    depth: float = DEPTH
    count: int = 16
    largest: float = 8.0


@dataclass(frozen=True)
class Level:
    """One level of one choice: relative changes of the results against the finest level.

    ``order`` is the observed order of the deflection between this level and the next, where the
    levels are sizes; None elsewhere.
    """

    choice: str
    value: str
    default: bool
    changes: dict[str, float]
    order: float | None = None


def _mesh(key: str) -> Callable[[Any], Numerics]:
    return lambda value: Numerics(mesh=replace(MeshSettings(), **{key: value}))


def _border(key: str) -> Callable[[Any], Numerics]:
    return lambda value: Numerics(mesh=MeshSettings(border=replace(Border(), **{key: value})))


def _settings(key: str) -> Callable[[Any], Settings]:
    return lambda value: replace(Settings(), **{key: value})


# What each choice is made of and its levels, the last one the finest.
SIZE = "element size near the track [m]"
CHOICES: dict[str, tuple[Callable[[Any], Numerics | Settings], tuple[float, ...]]] = {
    SIZE: (_mesh("size"), (0.3, 0.21, 0.15, 0.105, 0.075)),
    "largest element [m]": (_mesh("largest"), (1.3, 0.9, 0.6)),
    "growth of elements": (_mesh("growth"), (1.5, 1.3, 1.15)),
    "real mesh beside the embankment [m]": (_mesh("side"), (0.4, 0.8, 1.6)),
    "border elements": (_border("elements"), (9, 13, 19)),
    "border length [m]": (_border("length"), (1000.0, 4000.0, 8000.0)),
    "border beyond, times 1/k": (_border("decays"), (8.0, 12.0, 18.0)),
    "border angle [degrees]": (lambda a: _border("angle")(math.radians(a)), (30.0, 60.0, 45.0)),
    "depth of the real mesh [m]": (lambda depth: Numerics(depth=depth), (5.5, 8.0, 11.0)),
    "E_x of the sleepers over E of their concrete": (
        _mesh("axial_ratio"),
        (1e-3, 1e-4, 1e-5, 1e-6),
    ),
    "largest wavenumber [rad/m]": (lambda k: Numerics(largest=k), (4.0, 8.0, 12.0)),
    "wavenumbers": (lambda count: Numerics(count=count), (16, 24, 36)),
    # Of the reduced bases, by the response that Step B uses.
    "quadrature panel [rad/m]": (_settings("panel"), (0.09, 0.045, 0.0225)),
    "tolerance of the bases": (_settings("tolerance"), (4e-2, 1e-2, 1e-3)),
}


def study_convergence(
    choices: tuple[str, ...] | None = None, progress: Progress = silent
) -> list[Level]:
    """Levels of every choice (or those named, of ``CHOICES``) on the case study's track, in order.

    Raises
    ------
    ValueError
        If a name is unknown.
    """
    wanted = tuple(CHOICES) if choices is None else choices
    unknown = sorted(set(wanted) - set(CHOICES))
    if unknown:
        raise ValueError(f"unknown choice {', '.join(unknown)}; choose from {', '.join(CHOICES)}")
    steps = sum(len(CHOICES[name][1]) for name in wanted)
    done = itertools.count(1)

    def step() -> None:
        progress("Convergence", next(done), steps)

    return [level for name in wanted for level in _levels(name, step)]


def _stored_answers(numerics: Numerics) -> dict[str, complex]:
    """``answers`` of the case study, read from the cache folder or computed and stored there."""
    plain = without_laws(CASE_STUDY_TRACK)
    key = digest_of({"format": FORMAT, "track": asdict(plain), "numerics": asdict(numerics),
                     "answers": [SPEED, *OMEGAS]})  # fmt: skip
    path = cache_folder() / f"convergence-{key[:32]}.npz"
    results = read_arrays(
        path,
        "convergence",
        lambda a: dict(zip(a["names"].tolist(), a["values"].tolist(), strict=True)),
    )
    if results is None:
        results = answers(CASE_STUDY_TRACK, numerics)
        values = np.array(list(results.values()), dtype=np.complex128)
        write_arrays(path, {"names": np.array(list(results)), "values": values})
    return results


def answers(track: SectionTrack, numerics: Numerics) -> dict[str, complex]:
    """Deflection [m/N], stresses [Pa/N] and compliances [m/N] by direct solutions."""
    section, bands = track_section(track, numerics.depth, numerics.mesh), Settings().bands
    parts = {k: section.for_wavenumbers(k, numerics.mesh.border) for k in (0.0, *bands)}

    def direct(k: float, omega: float) -> np.ndarray:
        part = parts[max(lower for lower in parts if lower <= k)]
        return outputs(part, k, solve(part, k, omega))

    x = -np.cos(np.pi * (np.arange(numerics.count) + 0.5) / numerics.count)
    lower, upper = math.log(SHIFT), math.log(numerics.largest + SHIFT)
    nodes = np.exp((lower + upper) / 2.0 + x * (upper - lower) / 2.0) - SHIFT

    def spectrum(omegas: np.ndarray, k: np.ndarray) -> np.ndarray:
        at_nodes = [direct(k, abs(w)) for k, w in zip(nodes, omegas, strict=True)]
        fitted = np.polynomial.chebyshev.chebfit(x, np.array(at_nodes), numerics.count - 1)
        at = (2.0 * np.log(k + SHIFT) - lower - upper) / (upper - lower)
        return np.asarray(np.polynomial.chebyshev.chebval(at, fitted)).T

    def loaded(values: np.ndarray, omega: np.ndarray, k: np.ndarray) -> np.ndarray:
        sign = np.where(omega >= 0.0, 1.0, -1.0)
        values = np.where(sign[:, None] > 0.0, values, values.conj())
        receptance, force = rail_coupling(track, k, omega, values[:, 0], sign)
        return np.column_stack([receptance, values[:, 1:] * force[:, None]])

    k, weights = _rule(numerics.largest, 0.0)
    moved = (weights @ loaded(spectrum(nodes * SPEED, k), k * SPEED, k)).real / np.pi
    results: dict[str, complex] = {"deflection": moved[0]}
    results |= _stresses(track, numerics.depth, moved[1:].reshape(4, -1)[2])
    for omega in OMEGAS:
        k, weights = _rule(numerics.largest, omega / SPEED)
        ahead = loaded(spectrum(omega + nodes * SPEED, k), omega + k * SPEED, k)
        behind = loaded(spectrum(omega - nodes * SPEED, k), omega - k * SPEED, k)
        total = complex(weights @ (ahead[:, 0] + behind[:, 0]))
        results[f"compliance, {omega:.0f} rad/s"] = total / (2.0 * np.pi)
    return results


def _rule(largest: float, jump: float) -> tuple[np.ndarray, np.ndarray]:
    """Wavenumbers and weights [N] rad/m; a panel ends where the damping of negative frequency begins."""
    edges = np.union1d(wavenumber_quadrature(largest, 0.1, 2).edges, [jump])
    x, w = np.polynomial.legendre.leggauss(12)
    half = np.diff(edges)[:, None] / 2.0
    return ((edges[:-1, None] + half) + half * x).ravel(), (half * w).ravel()


def _stresses(track: SectionTrack, depth: float, vertical: np.ndarray) -> dict[str, complex]:
    """σzz at the uppermost point of every layer; in the ground only at the usual depths."""
    grid = depth_grid(track, depth)
    stresses = {}
    for index, layer in enumerate(track.layers):
        if layer.width is not None or depth == DEPTH:
            stresses[f"stress, {layer.name}"] = complex(vertical[grid.layer == index][0])
    return stresses


def _levels(name: str, step: Callable[[], None]) -> Iterator[Level]:
    make, sizes = CHOICES[name]
    results = []
    for made in map(make, sizes):
        of = _stored_answers(made) if isinstance(made, Numerics) else _of_response(made)
        results.append(of)
        step()
    for i, size in enumerate(sizes[:-1]):
        order = None
        if name == SIZE and i + 2 < len(sizes):
            order = _order(sizes[i : i + 3], [v["deflection"] for v in results[i : i + 3]])
        default = make(size) in (Numerics(), Settings())
        yield Level(name, f"{size:g}", default, _changes(results[i], results[-1]), order)


def _changes(values: dict[str, complex], finest: dict[str, complex]) -> dict[str, float]:
    return {
        name: float(abs(value - finest[name]) / abs(finest[name]))
        for name, value in values.items()
        if name in finest
    }


def _order(sizes: Sequence[float], values: list[complex]) -> float | None:
    """Observed order from three levels, for sizes of any ratio; None if the changes do not fall."""
    first, second = abs(values[0] - values[1]), abs(values[1] - values[2])
    if not first > second > 0.0:
        return None
    orders = np.linspace(0.1, 12.0, 2400)
    ratio = (sizes[0] ** orders - sizes[1] ** orders) / (sizes[1] ** orders - sizes[2] ** orders)
    return float(orders[np.argmin(np.abs(ratio - first / second))])


def _of_response(settings: Settings) -> dict[str, complex]:
    response = section_response(CASE_STUDY_TRACK, DEPTH, settings)
    results: dict[str, complex] = {}
    for omega, s in zip(
        (0.0, *OMEGAS), response.spectra(SPEED, np.array([0.0, *OMEGAS])), strict=True
    ):
        compliance = complex(s.weights @ s.receptance) / (2.0 * np.pi)
        if omega == 0.0:
            vertical = np.einsum("q,qz->z", s.weights, s.stress[:, 2]).real / (2.0 * np.pi)
            results["deflection"] = compliance.real
            results |= _stresses(CASE_STUDY_TRACK, DEPTH, vertical)
        else:
            results[f"compliance, {omega:.0f} rad/s"] = compliance
    return results


def convergence_table(levels: list[Level]) -> str:
    """Markdown that reads as plain text: one line per level, the default ones marked."""
    names = list(dict.fromkeys(name for level in levels for name in level.changes))
    rows = [("choice", "level", *names, "order")]
    for level in levels:
        cells = [f"{level.changes[n]:.1e}" if n in level.changes else "" for n in names]
        order = "" if level.order is None else f"{level.order:.1f}"
        value = level.value + (" (default)" if level.default else "")
        rows.append((level.choice, value, *cells, order))
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    rows.insert(1, tuple("-" * width for width in widths))
    return "\n".join(
        "| " + " | ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)) + " |"
        for row in rows
    )
