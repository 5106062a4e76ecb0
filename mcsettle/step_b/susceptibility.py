"""Settlement susceptibility that varies along the track, in the second-order form.

A strain increment of group g at x is multiplied by 1 + h_g(x). Beside the form of ``spectral`` the growth
has, with w_g the weights, u_g(U) what settles on average and V_g = w_g L_g U the linear part,

    dU_n    += Σ_g { w_g u_g(U) h_gn + ½ Σ_{k+k'=n} h_gk V_gk'
                     + ½ Σ_{k−k'=n} (h_gk V*_gk' + V_gk h*_gk') },
    uniform += Σ_g ½ Re Σ_k h_gk V*_gk:

the forcing of the mean settlement and the products with the linear part; h times pairs of waves, of
third order, is left out. Fields are few (one, or one a layer): h_g is a multiple of one of them, so that
the groups of a field add up first. With the rail's bending every increment is multiplied by what the
rail follows of it, H_n.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.step_b.spectral import ModePairs, SettlementForm, fast_growth, growth


@dataclass(frozen=True)
class VaryingForm:
    """A form of E groups with support that varies, and a rail that follows.

    ``multipliers`` [F, E] of each field in each group (F may be 0); ``following`` [K] H_n, or None:
    the rail follows fully; ``first`` mode number of the band.
    """

    form: SettlementForm
    multipliers: np.ndarray
    following: np.ndarray | None
    first: int

    @property
    def n_fields(self) -> int:
        """Fields of susceptibility."""
        return len(self.multipliers)


def varying_growth(
    varying: VaryingForm,
    amplitudes: np.ndarray,
    weights: np.ndarray,
    pairs: ModePairs,
    fields: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """NumPy twin of the spectral kernels with varying support.

    Parameters
    ----------
    varying : VaryingForm
    amplitudes : complex [R, K], m
    weights : [R, E] growth of each group's cycle function times the settlement factor
    pairs : ModePairs
    fields : complex [R, F, M] of h at modes 1 … M = 2 n_max

    Returns
    -------
    complex [R, K] growth of the amplitudes, m, and [R] uniform settlement, m
    """
    form, u = varying.form, np.atleast_2d(amplitudes)
    change, uniform = growth(form, u, weights, pairs)
    for f, multiplier in enumerate(varying.multipliers):
        assert fields is not None
        own = weights * multiplier
        load = own @ form.constant + np.einsum("rk,rk->r", own @ form.mean, np.abs(u) ** 2)
        more, settled = _spread(fields[:, f], load, 0.5 * (own @ form.linear) * u, varying.first)
        change, uniform = change + more, uniform + settled
    if varying.following is not None:
        change = change * varying.following
    return change, uniform


def _spread(
    h: np.ndarray, load: np.ndarray, half: np.ndarray, first: int
) -> tuple[np.ndarray, np.ndarray]:
    """Growth [R, K] and uniform settlement [R] of one field h [R, M], ``half`` [R, K] being V/2."""
    n = half.shape[1]
    change = h[:, first - 1 : first - 1 + n] * load[:, None]
    for i in range(n):
        ahead = h[:, 2 * first + i - 1 : 2 * first + i - 1 + n]  # modes n_i + n_j
        change[:, i] += np.sum(ahead * half.conj(), axis=1)
        change[:, i] += np.sum(h[:, :i][:, ::-1] * half[:, :i], axis=1)  # n_i − n_j
        change[:, i] += np.sum(half[:, i + 1 :] * h[:, : n - 1 - i].conj(), axis=1)  # n_j − n_i
    uniform = np.sum(h[:, first - 1 : first - 1 + n] * half.conj(), axis=1).real
    return change, uniform


def fast_varying_growth(
    varying: VaryingForm,
    packed: np.ndarray,
    amplitudes: np.ndarray,
    weights: np.ndarray,
    pairs: ModePairs,
    fields: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """``varying_growth`` by the Taichi kernels; ``packed`` is ``varying.form.packed()``."""
    from mcsettle.kernels import varying as kernel

    form = varying.form
    change, uniform = fast_growth(form, packed, amplitudes, weights, pairs)
    if varying.n_fields and fields is not None:
        n, n_modes = amplitudes.shape
        kernel.add_rates(
            np.ascontiguousarray(amplitudes).view(float).reshape(n, n_modes, 2),
            np.ascontiguousarray(weights, dtype=float),
            (packed, form.constant, form.mean, varying.multipliers),
            real_pairs(fields),
            varying.first,
            change.view(float).reshape(n, n_modes, 2),
            uniform,
        )
    if varying.following is not None:
        change = change * varying.following
    return change, uniform


def real_pairs(fields: np.ndarray) -> np.ndarray:
    """Waves [R, F, M] as the kernels take them: real [R, F M, 2]."""
    return np.ascontiguousarray(fields, dtype=complex).view(float).reshape(len(fields), -1, 2)
