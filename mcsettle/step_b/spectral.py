"""The passage as a second-order form in the profile amplitudes: depths and axles folded in advance.

Below one axle, q² = σ_d² is a quadratic form in the dynamic stress s(x): q² = q0² + ℓ·s + s·A s.
Hence q^m to second order about the mean state (exactly, for m = 2) is

    q^m ≈ q0^m + g·s + s·B s,  g = (m/2) q0^(m−2) ℓ,
    B = (m/2) q0^(m−2) A + (m/2)(m/2 − 1)/2 q0^(m−4) ℓ ℓᵀ,

and with s = Re Σ U_k G_k e^{ikx} its Fourier amplitude at mode n is, G_k the dynamic stress transfer,

    (q^m)_n = g·G_n U_n + ½ Σ_{k+k'=n} (G_k·B G_k') U_k U_k' + Σ_{k−k'=n} (G_k·B G*_k') U_k U*_k'.

Weighted by strain scale and thickness these coefficients add up over depths and axles: no grid over x
remains and nothing aliases. ``SettlementForm`` holds them for one axle or a whole train, one group per
settling layer because each law has its own dependence on the cycles N.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.mode_pairs import ModePairs
from mcsettle.step_b.settlement import strain_scale
from mcsettle.step_b.stress import DEVIATOR, mean_state


@dataclass(frozen=True)
class SettlementForm:
    """Second-order form of one load (an axle or a whole train) for G settlement groups.

    In units of m per unit of cycle growth φ: ``constant`` [G] real and ``mean`` [G, K] real give the
    uniform settlement constant + Σ mean |U|²; ``linear`` [G, K], ``sums`` [G, P], ``differences``
    [G, M] complex give the growth of the amplitudes, and what settles in the modes beside the band.
    """

    constant: np.ndarray
    mean: np.ndarray
    linear: np.ndarray
    sums: np.ndarray
    differences: np.ndarray

    def packed(self, order: np.ndarray | None = None) -> np.ndarray:
        """Coefficients as one real array [G, K + P + M, 2], pairs in ``order`` [P + M]."""
        of_pairs = np.concatenate([self.sums, self.differences], axis=1)
        every = [self.linear, of_pairs if order is None else of_pairs[:, order]]
        joined = np.concatenate(every, axis=1)
        return np.ascontiguousarray(np.stack([joined.real, joined.imag], axis=-1))


def axle_form(
    transfer: TransferFunctions, axle: int, model: SettlementModel, pairs: ModePairs
) -> SettlementForm:
    """Second-order form of one axle of ``transfer`` (units: SettlementForm)."""
    return train_form(transfer, model, pairs, np.array([axle]))


def train_form(
    transfer: TransferFunctions,
    model: SettlementModel,
    pairs: ModePairs,
    axles: np.ndarray | None = None,
) -> SettlementForm:
    """Form of a whole train (or of some of its ``axles``) at a frozen profile: the sum over axles."""
    grid = transfer.grid
    which = np.arange(len(transfer.quasi_static)) if axles is None else axles
    means = [mean_state(transfer.quasi_static[j], transfer.geostatic, model.stress) for j in which]
    p0 = np.einsum("dc,jcz->djz", DEVIATOR, np.stack(means))
    parts = []
    for layer in model.settling_layers:
        law = model.laws[layer]
        assert law is not None
        here = grid.layer == layer
        stresses = transfer.dynamic[which][..., here].transpose(1, 2, 0, 3)  # [K, 4, J, Z]
        weight = np.tile(strain_scale(law) * grid.weights[here], len(which))
        response = DEVIATOR @ stresses.reshape(*stresses.shape[:2], -1)
        parts.append(
            _layer_form(p0[..., here].reshape(3, -1), response, weight, law.exponent, pairs)
        )
    return SettlementForm(*(np.stack(column) for column in zip(*parts, strict=True)))


def growth(
    form: SettlementForm, amplitudes: np.ndarray, weights: np.ndarray, pairs: ModePairs
) -> tuple[np.ndarray, np.ndarray]:
    """NumPy twin of the spectral kernel.

    Parameters
    ----------
    form : SettlementForm
    amplitudes : complex [R, K], m
    weights : [R, G] growth of each group's cycle function times the settlement factor
    pairs : ModePairs

    Returns
    -------
    complex [R, K] growth of the amplitudes, m, and [R] uniform settlement, m
    """
    u = np.atleast_2d(amplitudes)
    i, j = pairs.sums.T
    products = u[:, i] * u[:, j]
    p, q = pairs.differences.T
    conjugates = u[:, p] * np.conj(u[:, q])
    change = (weights @ form.linear) * u
    change += _sum_slices((weights @ form.sums) * products, pairs.sum_start)
    change += _sum_slices((weights @ form.differences) * conjugates, pairs.difference_start)
    uniform = weights @ form.constant + np.einsum("rk,rk->r", weights @ form.mean, np.abs(u) ** 2)
    return change, uniform


def fast_growth(
    form: SettlementForm,
    packed: np.ndarray,
    amplitudes: np.ndarray,
    weights: np.ndarray,
    pairs: ModePairs,
) -> tuple[np.ndarray, np.ndarray]:
    """``growth`` by the Taichi kernel; ``packed`` is ``form.packed()``."""
    from mcsettle.kernels import runtime, spectral

    runtime.start()
    n, n_modes = amplitudes.shape
    u = np.ascontiguousarray(amplitudes).view(float).reshape(n, n_modes, 2)
    change, uniform = np.empty_like(u), np.empty(n)
    w = np.ascontiguousarray(weights, dtype=float)
    spectral.evaluate_rates(u, w, packed, form.constant, form.mean, tables(pairs), change, uniform)
    return change.view(complex)[..., 0], uniform


def settled_beside(
    form: SettlementForm, amplitudes: np.ndarray, weights: np.ndarray, pairs: ModePairs
) -> np.ndarray:
    """What settles in the mode numbers beside the band: complex [R, 2 n_max], 0 in the band."""
    i, j = pairs.sums.T
    p, q = pairs.differences.T
    u = np.atleast_2d(amplitudes)
    return _sum_slices((weights @ form.sums) * (u[:, i] * u[:, j]), pairs.outer_sums) + _sum_slices(
        (weights @ form.differences) * (u[:, p] * np.conj(u[:, q])), pairs.outer_differences
    )


def stacked(forms: list[SettlementForm]) -> SettlementForm:
    """Forms side by side: groups of the first, then those of the second, and so on."""
    return SettlementForm(*(np.concatenate(c) for c in zip(*map(_arrays, forms), strict=True)))


def tables(pairs: ModePairs) -> tuple[np.ndarray, ...]:
    """The index tables in the order of the kernels' arguments."""
    return (pairs.sums, pairs.sum_start, pairs.differences, pairs.difference_start)


def outer_tables(pairs: ModePairs) -> tuple[np.ndarray, np.ndarray]:
    """Where the pairs that couple into each mode number beside the band begin."""
    return pairs.outer_sums, pairs.outer_differences


def march_tables(pairs: ModePairs) -> tuple[np.ndarray, ...]:
    """The index tables in the order of the arguments of ``burst``; coefficients in their ``order``."""
    terms = pairs.terms
    return terms.joined, terms.joined_start, terms.single, terms.single_start


def _layer_form(
    p0: np.ndarray, response: np.ndarray, weight: np.ndarray, m: float, pairs: ModePairs
) -> tuple[np.ndarray, ...]:
    """Form of one layer: mean deviator p0 [3, Z], response [K, 3, Z], weight [Z], exponent m.

    Z: its depths, below every axle that counts.
    """
    q2 = np.sum(p0**2, axis=0)
    first = weight * (m / 2.0) * q2 ** (m / 2.0 - 1.0)
    second = weight * (m / 2.0) * (m / 2.0 - 1.0) / 2.0 * q2 ** (m / 2.0 - 2.0)
    along = 2.0 * np.einsum("dz,kdz->kz", p0, response)  # ℓ·G_k at each depth
    linear = along @ first
    flat = response.reshape(len(response), -1)
    scaled = (response * first).reshape(len(response), -1)
    i, j = pairs.sums.T
    products = scaled @ flat.T + (along * second) @ along.T
    sums = np.where(i == j, 0.5, 1.0) * products[i, j]
    hermitian = scaled @ flat.conj().T + (along * second) @ along.conj().T
    p, q = pairs.differences.T
    constant = np.sum(weight * q2 ** (m / 2.0))
    return constant, 0.5 * np.real(np.diag(hermitian)), linear, sums, hermitian[p, q]


def _arrays(form: SettlementForm) -> tuple[np.ndarray, ...]:
    return (form.constant, form.mean, form.linear, form.sums, form.differences)


def _sum_slices(terms: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Sum ``terms`` [R, P] over the slices start[n]:start[n+1], giving [R, K]."""
    bounds = pairwise(start)
    return np.stack([terms[:, a:b].sum(axis=1) for a, b in bounds], axis=1)
