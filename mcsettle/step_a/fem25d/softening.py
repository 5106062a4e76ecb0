"""Equivalent-linear soil: moduli and damping that fit the strains of a passing train.

The train's static axle forces move at constant speed over the section, (k, ω = kv). In the centre of
every element of ballast, sub-ballast and ground the octahedral shear strain

    γ_oct = c √[(εxx-εyy)² + (εxx-εzz)² + (εyy-εzz)² + 6 (εxy² + εxz² + εyz²)],   c = 1/3 or 2/3,

(ε tensor strains; 2/3 is the engineering shear strain of the octahedral plane) has a maximum over the
passage; a share of it, 0.65 by default, is the effective strain from which the layer's curve gives
the next modulus and damping. The damping never falls below that of the layer. Poisson's ratio stays.
"""

import functools
import warnings
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from mcsettle.errors import NumericalError, check_positive
from mcsettle.railway.modulus_curves import Curve, reduction
from mcsettle.railway.softening_choices import OCTAHEDRAL, SofteningSettings
from mcsettle.railway.track import SectionTrack, without_laws
from mcsettle.railway.traffic import Train
from mcsettle.step_a.fem25d.element_scaling import Frame, track_frame
from mcsettle.step_a.fem25d.line_spectra import rail_coupling
from mcsettle.step_a.fem25d.passing_train import along_train, line_wavenumbers, places
from mcsettle.step_a.fem25d.section import MeshSettings
from mcsettle.step_a.fem25d.solve import SUPERLU
from mcsettle.step_a.fem25d.track_section import ElementProperties
from mcsettle.types import Progress, silent

WAVENUMBERS = 16  # solutions per iteration
CHUNK = 400  # places along the train handled together
LARGEST_DAMPING = 0.45
LARGEST_MIX = 3.0  # largest share of the last step in an extrapolation


@dataclass(frozen=True, eq=False)
class SofteningHistory:
    """How the iteration went; I iterations, L layers from the sleeper down.

    ``change`` [I] is the largest relative change of a modulus; after each iteration ``lowest`` and
    ``mean`` [I, L] Pa are Young's modulus over the regular mesh (``mean`` by area), ``strain`` [I, L]
    the largest effective strain and ``damping`` [I, L] the largest damping.
    """

    layers: tuple[str, ...]
    change: np.ndarray
    lowest: np.ndarray
    mean: np.ndarray
    strain: np.ndarray
    damping: np.ndarray
    converged: bool

    @property
    def iterations(self) -> int:
        """Number of iterations."""
        return int(self.change.size)

    def text(self) -> str:
        """One line per iteration: change, and per layer lowest and mean modulus in MPa."""
        lines = []
        for i in range(self.iterations):
            moduli = ", ".join(
                f"{name} {self.lowest[i, n] / 1e6:.1f}/{self.mean[i, n] / 1e6:.1f}"
                for n, name in enumerate(self.layers)
            )
            lines.append(f"iteration {i + 1}: change {self.change[i]:.2%}; MPa: {moduli}")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class SoftenedGround:
    """Properties of every element that fit one train at one speed, and the history of the iteration."""

    properties: ElementProperties
    history: SofteningHistory


def soften(
    track: SectionTrack,
    train: Train,
    speed: float,
    integration_depth: float = 5.5,
    mesh: MeshSettings | None = None,
    settings: SofteningSettings | None = None,
    progress: Progress = silent,
    frame: Frame | None = None,
    start: ElementProperties | None = None,
) -> SoftenedGround:
    """Equivalent-linear properties of a track and its ground under one train at one speed.

    Parameters
    ----------
    track : SectionTrack
        Track and ground at small strains.
    train : Train
        Its static axle forces load the track; all axles act.
    speed : float
        Speed [m/s].
    integration_depth : float
        Depth [m] of the real mesh below the subgrade surface.
    mesh : MeshSettings, optional
        Element sizes; those of the response the properties are meant for.
    settings : SofteningSettings, optional
        Strain measure, curves, tolerance.
    progress : callable, optional
        Called as ``progress(stage, iterations, most)`` after each iteration.
    frame : Frame, optional
        ``track_frame(track, integration_depth, mesh)``, if it exists already.
    start : ElementProperties, optional
        Where the iteration starts, such as the ground of another speed; default the small-strain
        ground. The result depends on it within the tolerance.

    Raises
    ------
    ValueError
        If the speed is not positive and finite, or a curve names an unknown layer.
    NumericalError
        If the iteration does not converge (unless ``settings.keep_last``: then a warning).
    """
    settings = SofteningSettings() if settings is None else settings
    check_positive("speed", speed, "m/s")
    curves = settings.layer_curves(track)
    if frame is None:
        plain = without_laws(track)
        frame = _frame(plain, integration_depth, mesh or MeshSettings())
    elements = frame.elements
    layer_damping = np.array([layer.material.damping for layer in track.layers])[elements.layer]
    state = np.stack([np.ones(elements.number.size), layer_damping])
    if start is not None:
        state = np.stack([start.scale[elements.number], start.damping[elements.number]])
    final, records = _iterate(frame, curves, train, speed, state, settings, progress)
    history = _history(track, records, records[-1][0] <= settings.tolerance)
    if not history.converged:
        _not_converged(history, settings, train.name, speed)
    return SoftenedGround(elements.spread(track, frame.grid, *final), history)


def _iterate(
    frame: Frame,
    curves: tuple[Curve, ...],
    train: Train,
    speed: float,
    state: np.ndarray,
    settings: SofteningSettings,
    progress: Progress,
) -> tuple[np.ndarray, list[tuple[float, np.ndarray]]]:
    """Share of the modulus and damping [2, R] at the end, and (change, summary) of every iteration."""
    track, elements = frame.track, frame.elements
    layer_damping = np.array([layer.material.damping for layer in track.layers])[elements.layer]
    wavenumbers = line_wavenumbers(WAVENUMBERS)
    passing = along_train(train, wavenumbers, places(train))
    records: list[tuple[float, np.ndarray]] = []
    steps: list[tuple[np.ndarray, np.ndarray]] = []
    for _ in range(settings.max_iterations):
        # One iteration maps moduli to the strains they give, and these by the curves to new moduli.
        properties = elements.spread(track, frame.grid, *state)
        spectra = strain_spectra(frame, properties, wavenumbers, speed)
        strain = settings.strain_factor * largest_octahedral(spectra, passing, settings.octahedral)
        image = _by_curve(curves, strain, elements.layer, elements.confinement, layer_damping)
        change = float(np.max(np.abs(image[0] / state[0] - 1.0)))
        records.append((change, _summary(frame, image[0], strain, image[1])))
        stage = f"Softening at {speed * 3.6:.0f} km/h"
        progress(stage, len(records), settings.max_iterations)
        if change <= settings.tolerance:
            break
        steps.append((state, image))
        state = _next(steps)
    return image, records


@functools.lru_cache(maxsize=1)
def _frame(track: SectionTrack, integration_depth: float, mesh: MeshSettings) -> Frame:
    """Frame of the last track: the grounds of one study share their elements."""
    return track_frame(track, integration_depth, mesh)


def strain_spectra(
    frame: Frame, properties: ElementProperties, wavenumbers: np.ndarray, speed: float
) -> np.ndarray:
    """Strains ε̃(k, kv) [6, R, J] per unit force per wheelset at the centres of the soft elements.

    Order xx, yy, zz, yz, xy, xz; the last three are engineering shear strains. [1/N·m]
    """
    k0, k1, k2 = frame.stiffness(properties)
    count = frame.elements.number.size
    foot = np.empty(wavenumbers.size, dtype=np.complex128)
    strains = np.empty((6, count, wavenumbers.size), dtype=np.complex128)
    for j, k in enumerate(wavenumbers.tolist()):
        data = k0.data + k * k1.data + k**2 * k2.data - (k * speed) ** 2 * frame.mass.data
        operator, inside = sp.csc_matrix((data, k0.indices, k0.indptr), k0.shape), frame.needed(k)
        lu = spla.splu(operator[inside][:, inside].tocsc(), **SUPERLU)
        u = np.zeros(frame.load.size, dtype=np.complex128)
        u[inside] = lu.solve(frame.load[inside].astype(np.complex128))
        foot[j] = frame.load @ u
        strains[:, :, j] = (frame.strain0 @ u + k * (frame.strain1 @ u)).reshape(6, count)
    strains[4:] *= 1j  # u = (i ũx, uy, uz)
    force = rail_coupling(frame.track, wavenumbers, wavenumbers * speed, foot)[1]
    return np.asarray(strains * force)


def largest_octahedral(spectra: np.ndarray, passing: np.ndarray, octahedral: str) -> np.ndarray:
    """Largest octahedral shear strain [R] over the places of a passing train.

    ``spectra`` [6, R, J] as of ``strain_spectra``, ``passing`` [J, X] as of ``along_train``.
    """
    largest = np.zeros(spectra.shape[1])
    for start in range(0, passing.shape[1], CHUNK):
        part = passing[:, start : start + CHUNK]
        strain = (spectra.real @ part.real) - (spectra.imag @ part.imag)
        strain[3:] /= 2.0
        largest = np.maximum(largest, octahedral_strain(strain, octahedral).max(axis=-1))
    return largest


def octahedral_strain(strain: np.ndarray, octahedral: str = "engineering") -> np.ndarray:
    """Octahedral shear strain of tensor strains [6, ...] in the order xx, yy, zz, yz, xy, xz.

    "engineering" is 2 √(J₂' · 2/3) of the deviatoric strain; "third" is half of it.

    >>> round(1e3 * float(octahedral_strain(np.array([1e-3, 0.0, 0.0, 0.0, 0.0, 0.0]))), 6)  # 2√2/3
    0.942809
    """
    xx, yy, zz, yz, xy, xz = strain
    normal = (xx - yy) ** 2 + (xx - zz) ** 2 + (yy - zz) ** 2
    return OCTAHEDRAL[octahedral] * np.sqrt(normal + 6.0 * (yz**2 + xy**2 + xz**2))


def _by_curve(
    curves: tuple[Curve, ...],
    strain: np.ndarray,
    layer: np.ndarray,
    confinement: np.ndarray,
    layer_damping: np.ndarray,
) -> np.ndarray:
    """Share of the modulus and damping [2, R] at effective strains."""
    scale, damping = np.ones_like(strain), layer_damping.copy()
    for index, curve in enumerate(curves):
        at = layer == index
        scale[at], curve_damping = reduction(curve, strain[at], confinement[at])
        damping[at] = np.minimum(np.maximum(layer_damping[at], curve_damping), LARGEST_DAMPING)
    return np.stack([scale, damping])


def _next(steps: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Next state [2, R] after steps (state, its image): the image, extrapolated.

    The iteration contracts by about one half per step, much the same in every element. The last
    two steps are combined (Anderson's mixing with one step of memory, on the logarithms of the moduli)
    so that their residuals cancel best.
    """
    (before, image_before), (state, image) = steps[-2] if len(steps) > 1 else steps[-1], steps[-1]
    residual = np.log(image[0] / state[0])
    slope = residual - np.log(image_before[0] / before[0])
    share = float(residual @ slope / max(slope @ slope, 1e-300))
    share = min(max(share, -LARGEST_MIX), LARGEST_MIX) if len(steps) > 1 else 0.0
    scale = np.minimum(image[0] * (image[0] / image_before[0]) ** -share, 1.0)
    damping = np.clip(image[1] - share * (image[1] - image_before[1]), 0.0, LARGEST_DAMPING)
    return np.stack([scale, damping])


def _summary(
    frame: Frame, scale: np.ndarray, strain: np.ndarray, damping: np.ndarray
) -> np.ndarray:
    """Lowest and mean modulus [Pa], largest strain and damping of every layer, [4, L]."""
    soft, rows = frame.elements, []
    for index, layer in enumerate(frame.track.layers):
        at = soft.layer == index
        modulus = layer.material.youngs_modulus * scale[at]
        mean = np.average(modulus, weights=soft.area[at])
        rows.append([modulus.min(), mean, strain[at].max(), damping[at].max()])
    return np.array(rows).T


def _history(
    track: SectionTrack, records: list[tuple[float, np.ndarray]], converged: bool
) -> SofteningHistory:
    change = np.array([record[0] for record in records])
    lowest, mean, strain, damping = np.stack([record[1] for record in records], axis=1)
    names = tuple(layer.name for layer in track.layers)
    return SofteningHistory(names, change, lowest, mean, strain, damping, converged)


def _not_converged(
    history: SofteningHistory, settings: SofteningSettings, train: str, speed: float
) -> None:
    message = (
        f"the softening of the ground under '{train}' at {speed * 3.6:.0f} km/h did not converge: "
        f"moduli still change by {history.change[-1]:.1%} after {history.iterations} iterations "
        f"(tolerance {settings.tolerance:.1%})"
    )
    if not settings.keep_last:
        raise NumericalError(
            f"{message}; raise max_iterations or tolerance, or set keep_last = true to continue with "
            "the last iterate"
        )
    warnings.warn(f"{message}; the last iterate is used", RuntimeWarning, stacklevel=3)
