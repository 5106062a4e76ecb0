"""Deviatoric stress under a train: against depth, along the track, at one height (Figs. 15, 16)."""

import math
from dataclasses import dataclass

import numpy as np

from mcsettle.railway.spectra import Spectrum
from mcsettle.railway.traffic import Train
from mcsettle.step_a.transfer import DepthGrid, TrackResponse, TransferFunctions
from mcsettle.step_b.stress import DEVIATOR, deviatoric_stress

CHUNK = 128  # places along the track evaluated together


@dataclass(frozen=True)
class DepthCurve:
    """Deviatoric stress against depth for one train at one speed.

    ``z`` [Z] m (up, 0 at the subgrade surface), ``layer`` [Z]; ``quasi_static`` [Z] Pa, mean over
    the axles, each overhead; ``dynamic`` [Z] Pa, root mean square over profile and axles of the
    dynamic part alone.
    """

    label: str
    z: np.ndarray
    layer: np.ndarray
    quasi_static: np.ndarray
    dynamic: np.ndarray


@dataclass(frozen=True)
class StressAlong:
    """Quasi-static deviatoric stress ``sigma`` [D, X] Pa around a train, at places and heights.

    ``x`` [X] m from the middle of the car looked at, positive forward; ``heights`` [D] m;
    ``axles`` [A] m, where the axles within ``x`` stand.
    """

    label: str
    x: np.ndarray
    heights: np.ndarray
    sigma: np.ndarray
    axles: np.ndarray


def profile_power(
    spectrum: Spectrum, wavenumbers: np.ndarray, window: float, sd: float | None
) -> np.ndarray:
    """Share of each mode in the variance of the profile [K] m²: S(k) Δk, scaled to ``sd`` [m]."""
    power = np.asarray(spectrum(wavenumbers) * 2.0 * math.pi / window)
    return power if sd is None else power * (sd**2 / power.sum())


def layer_weights(grid: DepthGrid, layer: int, z: float) -> np.ndarray:
    """Weights [Z] that carry values at the depths of ``layer`` to the height ``z`` [m] in it.

    Polynomial through the three depths of the layer nearest to z; at a layer's very edge it
    extrapolates by a fraction of their distance.

    Raises
    ------
    ValueError
        If the layer has no depths.
    """
    here = np.flatnonzero(grid.layer == layer)
    if here.size == 0:
        raise ValueError(f"no stresses are given in layer {layer}")
    near = here[np.argsort(np.abs(grid.z[here] - z), kind="stable")[:3]]
    weights = np.zeros(grid.z.size)
    for i in near:
        others = grid.z[near[near != i]]
        weights[i] = np.prod((z - others) / (grid.z[i] - others))
    return weights


def depth_curve(transfer: TransferFunctions, power: np.ndarray, label: str) -> DepthCurve:
    """σ_d against depth; ``power`` [K] m² is ``profile_power``."""
    overhead = quasi_static_overhead(transfer, np.eye(transfer.grid.z.size))
    squares = dynamic_squares(transfer, np.eye(transfer.grid.z.size))
    return DepthCurve(
        label, transfer.grid.z, transfer.grid.layer, overhead, np.sqrt(power @ squares)
    )


def quasi_static_overhead(transfer: TransferFunctions, weights: np.ndarray) -> np.ndarray:
    """Quasi-static σ_d [D] Pa with an axle overhead, mean over the train's axles.

    ``weights`` [D, Z] carry the stresses to D heights (``layer_weights``).
    """
    stress = np.moveaxis(transfer.quasi_static @ weights.T, 1, 0)
    return np.asarray(deviatoric_stress(*stress).mean(axis=0))


def dynamic_squares(transfer: TransferFunctions, weights: np.ndarray) -> np.ndarray:
    """|D σ|² of the dynamic part per unit power of each mode, mean over the axles, [K, D] Pa²/m².

    σ_d² is the quadratic form |D σ|², so its mean over x is the sum over the modes of their power
    [m²] times this. ``weights`` [D, Z] as in ``quasi_static_overhead``.
    """
    states = np.einsum("ic,jkcd->jkid", DEVIATOR, transfer.dynamic @ weights.T)
    return np.asarray((np.abs(states) ** 2).sum(axis=2).mean(axis=0))


def change_squares(transfer: TransferFunctions, weights: np.ndarray) -> np.ndarray:
    """As ``dynamic_squares``, of the change of σ_d that a small dynamic stress makes.

    About the quasi-static state σ_d changes by n · (D σ), n the direction of the quasi-static D σ.
    """
    states = np.einsum("ic,jkcd->jkid", DEVIATOR, transfer.dynamic @ weights.T)
    mean = np.einsum("ic,jcd->jid", DEVIATOR, transfer.quasi_static @ weights.T)
    direction = mean / np.linalg.norm(mean, axis=1, keepdims=True)
    change = np.einsum("jid,jkid->jkd", direction, states)
    return np.asarray((np.abs(change) ** 2).mean(axis=0))


def stress_along(
    response: TrackResponse, train: Train, speed: float, heights: np.ndarray, weights: np.ndarray
) -> StressAlong:
    """Quasi-static σ_d around the middle car of ``train`` at ``speed`` [m/s].

    Parameters
    ----------
    response : TrackResponse
    train : Train
        All of its axles act.
    speed : float, m/s
    heights : ndarray, shape [D], m
    weights : ndarray, shape [D, Z]
        Carry the stresses to the heights (``layer_weights``).
    """
    middle = len(train.cars) // 2
    axles = train.axle_positions[4 * middle : 4 * middle + 4]
    centre, half = float(axles.mean()), train.cars[middle].length / 2.0 + 4.0
    x = np.linspace(-half, half, 2 * math.ceil(half / 0.1) + 1)
    spectra = next(response.spectra(speed, np.zeros(1)))
    k = spectra.wavenumbers
    load = train.axle_forces @ np.exp(1j * np.outer(train.axle_positions, k))
    load = load * spectra.weights / (2.0 * math.pi)
    kernel = (spectra.stress @ weights.T).reshape(k.size, -1) * load[:, None]
    parts = [
        (np.exp(-1j * np.outer(centre + x[i : i + CHUNK], k)) @ kernel).real
        for i in range(0, x.size, CHUNK)
    ]
    stress = np.concatenate(parts).reshape(x.size, 4, -1)
    sigma = deviatoric_stress(*np.moveaxis(stress, 1, 0)).T
    near = train.axle_positions - centre
    return StressAlong(
        f"{train.name}, {speed * 3.6:.0f} km/h", x, heights, sigma, near[np.abs(near) <= half]
    )
