"""Settlement susceptibility that varies along the track, in the second-order form.

A strain increment of group g at x is multiplied by 1 + h_g(x). Let Q_gm be what group g settles at mode
number m, with its weight, to second order in the profile U: u_g(U) on average, for m = 1 … 2 n_max the
form's linear part and its pairs of waves, in the band and beside it. To the form of ``spectral`` add

    dU_n    += Σ_g { u_g h_gn + ½ Σ_{k+m=n} h_gk Q_gm + ½ Σ_{k−m=n} h_gk Q*_gm + ½ Σ_{m−k=n} h*_gk Q_gm },
    uniform += Σ_g ½ Re Σ_k h_gk Q*_gk:

the product of h with what settles, without a grid. Only what the form itself leaves out is left out.
Fields are few (one, or one a layer): h_g is a multiple of one of them, so that the groups of a field add
up first. With the rail's bending every increment is multiplied by what the rail follows of it, H_n.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.step_b.mode_pairs import ModePairs
from mcsettle.step_b.spectral import (
    SettlementForm,
    fast_growth,
    growth,
    outer_tables,
    settled_beside,
    tables,
)


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
        of_field, n = weights * multiplier, u.shape[1]
        settled, load = growth(form, u, of_field, pairs)
        half = 0.5 * settled_beside(form, u, of_field, pairs)
        half[:, varying.first - 1 : varying.first - 1 + n] = 0.5 * settled
        more, raised = _spread(fields[:, f], load, half, varying.first, n)
        change, uniform = change + more, uniform + raised
    if varying.following is not None:
        change = change * varying.following
    return change, uniform


def _spread(
    h: np.ndarray, load: np.ndarray, half: np.ndarray, first: int, n_modes: int
) -> tuple[np.ndarray, np.ndarray]:
    """Growth [R, K] and uniform settlement [R] of one field h [R, M] and half of what settles [R, M]."""
    change = h[:, first - 1 : first - 1 + n_modes] * load[:, None]
    for i in range(n_modes):
        n = first + i
        change[:, i] += np.sum(h[:, n:] * half[:, :-n].conj(), axis=1)  # h at n + m
        change[:, i] += np.sum(h[:, : n - 1][:, ::-1] * half[:, : n - 1], axis=1)  # at n − m
        change[:, i] += np.sum(h[:, :-n].conj() * half[:, n:], axis=1)  # at m − n
    return change, np.sum(h * half.conj(), axis=1).real


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
            (*tables(pairs), *outer_tables(pairs)),
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
