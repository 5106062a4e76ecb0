"""The passage at every x and depth, for many realisations: what the spectral form is checked against.

Where a law's exponent is 2, Σ_z c_z |p_z + s_z(x)|² (p the mean deviator, s the dynamic one, c strain
scale times thickness) is a constant, a linear part that needs no grid, and a sum of squares of fields.
By a singular value decomposition of the weighted fields √c_z s_z a few fields have the same sum of
squares; what is cut off is the ``tolerance`` part of that sum. Other exponents take every deviator at
every depth. Two fields share one complex transform: z(x) = f(x) + i g(x) with f = Re Σ U_k F_k e^{ikx}
has the coefficients ½ (F + iG) U at k and ½ ((F − iG) U)* at −k.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.spatial_variability import to_points
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.passage import grid_size, mode_numbers
from mcsettle.step_b.settlement import strain_scale
from mcsettle.step_b.stress import DEVIATOR, mean_state

TOLERANCE = 1e-4  # of the sum of squares where the exponent is 2
LARGEST_EXPONENT = 10.0  # of the kernel's power
# What becomes of the two fields of a transform.
SQUARES, BEGIN, NEXT, FINISH, PLAIN = 0, 1, 2, 3, 4


@dataclass(frozen=True)
class PointwiseLoad:
    """One train as the pointwise kernel takes it: J axles, T transforms, G groups, X grid points.

    ``start`` [J + 1] first transform of each axle; ``kind`` [T, 3] what becomes of its two fields and
    their groups; ``law`` [T, 2] coefficient of what settles, and exponent; ``mean`` [T, 2] of the two
    fields; ``response`` [T, K, 4] factors of U_k at k and, conjugate, of U*_k at −k, real and imaginary
    parts; ``linear`` [J, G, K, 2] and ``constant`` [J, G] parts that need no grid; ``first_mode``.
    Where the support varies: ``closes`` [T] the part of the groups that ends with each transform, or −1;
    ``parts`` [P, F] multipliers of the fields in each part.
    """

    start: np.ndarray
    kind: np.ndarray
    law: np.ndarray
    mean: np.ndarray
    response: np.ndarray
    linear: np.ndarray
    constant: np.ndarray
    n_points: int
    first_mode: int
    closes: np.ndarray
    parts: np.ndarray

    def strain_factors(self, fields: np.ndarray) -> np.ndarray:
        """1 + h [R, P X] in every part at every x, in the kernel's order; fields [R, F, M]."""
        mixed = np.einsum("pf,rfm->rpm", self.parts, fields)
        factors = 1.0 + to_points(mixed, self.n_points)[..., points_in_order(self.n_points)]
        return np.ascontiguousarray(factors.reshape(len(fields), -1))

    @property
    def n_axles(self) -> int:
        """Axles of the train."""
        return len(self.constant)


# Kind and groups, law, means, factors of the two fields.
Transform = tuple[
    tuple[int, int, int], tuple[float, float], tuple[float, float], np.ndarray, np.ndarray
]


def pointwise_load(
    transfer: TransferFunctions,
    model: SettlementModel,
    window: float,
    tolerance: float = TOLERANCE,
    parts: "LoadParts | None" = None,
) -> PointwiseLoad:
    """Lay the transfer functions out for the pointwise kernel, in ``parts`` where the support varies.

    ``tolerance`` bounds the part of the sum of squares of the dynamic stress, over depth and modes,
    that layers of exponent 2 leave out (0: nothing), in the part of the growth that is quadratic in the
    profile; the rest is exact. With the default the growth errs by some 1e-6 of its largest at 1 mm SD,
    in proportion to the SD: as much as aliasing on a grid of so few points, as in ``passage``.

    Raises
    ------
    ValueError : an exponent above 10.
    """
    worst = max(law.exponent for law in model.group_laws)
    if worst > LARGEST_EXPONENT:
        raise ValueError(f"settlement exponent {worst}; at most {LARGEST_EXPONENT} here")
    modes = mode_numbers(transfer.wavenumbers, window)
    axles, closes, n_groups = [], [], len(model.settling_layers)
    # No linear and constant part beside the grid where the support varies.
    beside = np.zeros((n_groups, len(modes)), dtype=complex), np.zeros(n_groups)
    for j in range(len(transfer.quasi_static)):
        if parts is None:
            of_axle, rest = (axle := _axle(transfer, model, j, tolerance))[0], axle[1:]
            ends = [-1] * len(of_axle)
        else:
            of_axle, ends, rest = [], [], beside
            for part, groups in enumerate(parts.groups):
                more = _part(transfer, model, j, tolerance, groups)
                of_axle, ends = of_axle + more, ends + [-1] * (len(more) - 1) + [part]
        axles.append((of_axle, *rest))
        closes += ends
    transforms = [transform for of_axle, _, _ in axles for transform in of_axle]
    kind, law, mean, f, h = (np.array(part) for part in zip(*transforms, strict=True))
    above, below = 0.5 * (f + 1j * h), 0.5 * (f - 1j * h)
    linear = np.stack([part for _, part, _ in axles])
    return PointwiseLoad(
        start=np.cumsum([0] + [len(of_axle) for of_axle, _, _ in axles]).astype(np.int32),
        kind=kind.astype(np.int32),
        law=law,
        mean=mean,
        response=np.stack([above.real, above.imag, below.real, below.imag], axis=-1),
        linear=np.stack([linear.real, linear.imag], axis=-1),
        constant=np.stack([part for _, _, part in axles]),
        n_points=grid_size(int(modes.max()), parts is not None),
        first_mode=int(modes[0]),
        closes=np.array(closes, dtype=np.int32),
        parts=np.zeros((0, 0)) if parts is None else parts.multipliers,
    )


@dataclass(frozen=True)
class LoadParts:
    """Settlement groups whose strain has the same factor at every x: ``groups`` and their fields'
    ``multipliers`` [P, F].
    """

    groups: tuple[tuple[int, ...], ...]
    multipliers: np.ndarray


def load_parts(multipliers: np.ndarray) -> LoadParts | None:
    """Parts of the groups by the ``multipliers`` [F, G] of the fields in them; None: no field."""
    if not len(multipliers):
        return None
    different, part = np.unique(multipliers.T, axis=0, return_inverse=True)
    groups = [tuple(np.flatnonzero(part == p).tolist()) for p in range(len(different))]
    return LoadParts(tuple(groups), different)


def points_in_order(n_points: int) -> np.ndarray:
    """Numbers [X] of the grid points in the order in which the kernel's transforms leave them."""
    from mcsettle.kernels.fourier import radices

    order, step = np.zeros(1, dtype=int), 1
    for radix in (4, *radices(n_points), 4):
        order = (order[:, None] + step * np.arange(radix)).ravel()
        step *= radix
    return order


def _part(
    transfer: TransferFunctions,
    model: SettlementModel,
    axle: int,
    tolerance: float,
    groups: tuple[int, ...],
) -> list[Transform]:
    """Transforms of one axle for some of the groups, all that settles on the grid."""
    transforms, linear, constant = _axle(transfer, model, axle, tolerance, groups)
    plain = [(g, constant[g], linear[g]) for g in groups if constant[g] != 0.0]
    if len(plain) % 2:
        plain = [*plain, (plain[-1][0], 0.0, np.zeros_like(plain[-1][2]))]
    return transforms + [
        ((PLAIN, a, b), (1.0, 1.0), (ca, cb), f, h)
        for (a, ca, f), (b, cb, h) in zip(plain[::2], plain[1::2], strict=True)
    ]


def _axle(
    transfer: TransferFunctions,
    model: SettlementModel,
    axle: int,
    tolerance: float,
    groups: tuple[int, ...] | None = None,
) -> tuple[list[Transform], np.ndarray, np.ndarray]:
    """Transforms of one axle (for some of the groups), complex [G, K] linear and [G] constant part."""
    state = mean_state(transfer.quasi_static[axle], transfer.geostatic, model.stress)
    n_groups, n_modes = len(model.settling_layers), len(transfer.wavenumbers)
    linear, constant = np.zeros((n_groups, n_modes), dtype=complex), np.zeros(n_groups)
    transforms: list[Transform] = []
    squares: list[tuple[int, np.ndarray]] = []
    for g, layer in enumerate(model.settling_layers):
        if groups is not None and g not in groups:
            continue
        law, here = model.group_laws[g], transfer.grid.layer == layer
        c = strain_scale(law) * transfer.grid.weights[here]
        p = DEVIATOR @ state[:, here]
        s = np.einsum("dc,kcz->dzk", DEVIATOR, transfer.dynamic[axle][..., here])
        if law.exponent == 2.0:
            constant[g] = np.sum(c * p**2)
            linear[g] = 2.0 * np.einsum("z,dz,dzk->k", c, p, s)
            fields = (np.sqrt(c)[:, None] * s).reshape(-1, n_modes)
            squares += [(g, field) for field in _principal(fields, tolerance)]
        else:
            transforms += _depths(g, law.exponent, c, p, s)
    return transforms + _squares(squares), linear, constant


def _principal(fields: np.ndarray, tolerance: float) -> np.ndarray:
    """Few fields [F', K] whose squares at every x add up to those of ``fields`` [F, K]."""
    n = fields.shape[1]
    stack = np.concatenate([fields.real, fields.imag], axis=1)
    _, s, v = np.linalg.svd(stack, full_matrices=False)
    left_out = np.cumsum(s[::-1] ** 2)[::-1]
    keep = left_out > tolerance * left_out[0]
    v = s[keep, None] * v[keep]
    return v[:, :n] + 1j * v[:, n:]


def _squares(fields: list[tuple[int, np.ndarray]]) -> list[Transform]:
    """Transforms of pairs of (group, field) whose squares count."""
    if len(fields) % 2:
        fields = [*fields, (fields[-1][0], np.zeros_like(fields[-1][1]))]
    return [
        ((SQUARES, a, b), (1.0, 2.0), (0.0, 0.0), f, h)
        for (a, f), (b, h) in zip(fields[::2], fields[1::2], strict=True)
    ]


def _depths(
    group: int, exponent: float, c: np.ndarray, p: np.ndarray, s: np.ndarray
) -> list[Transform]:
    """Transforms of the deviators s [3, Z, K] about p [3, Z], depths in pairs.

    c σ_d^m = c' (r σ_d)^m with r = (c/c')^(1/m), so that one coefficient c' serves all depths: the
    deviators carry the rest. A last depth without a partner is taken twice, half each time.
    """
    if len(c) % 2:
        paired = [*range(len(c)), len(c) - 1]
        c, p, s = c[paired], p[:, paired], s[:, paired]
        c[-2:] /= 2.0
    law = (float(c.max()), exponent)
    ratio = (c / c.max()) ** (1.0 / exponent)
    p, s = ratio * p, ratio[:, None] * s
    transforms: list[Transform] = []
    for z in range(0, len(c), 2):
        for i, kind in enumerate((BEGIN, NEXT)):
            means = (p[0, z + i], p[1, z + i])
            transforms.append(((kind, group, group), law, means, s[0, z + i], s[1, z + i]))
        means = (p[2, z], p[2, z + 1])
        transforms.append(((FINISH, group, group), law, means, s[2, z], s[2, z + 1]))
    return transforms


def pointwise_growth(
    load: PointwiseLoad,
    axles: np.ndarray,
    amplitudes: np.ndarray,
    weights: np.ndarray,
    factors: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Growth under the given axles at a frozen profile, by the Taichi kernel.

    Parameters
    ----------
    load : PointwiseLoad
    axles : indices of the axles that pass
    amplitudes : complex [R, K], m
    weights : [R, G] growth of each group's cycle function times the settlement factor
    factors : [R, P X] of ``strain_factors``, where the support varies

    Returns
    -------
    complex [R, K] growth of the amplitudes, m, and [R] uniform settlement, m
    """
    from mcsettle.kernels import pointwise, runtime

    runtime.start()
    n, n_modes = amplitudes.shape
    u = np.ascontiguousarray(amplitudes).view(float).reshape(n, n_modes, 2)
    change, uniform = np.empty_like(u), np.empty(n)
    w = np.ascontiguousarray(weights, dtype=float)
    which = np.ascontiguousarray(axles, dtype=np.int32)
    pointwise.evaluate(u, w, which, tables(load), factors, change, uniform)
    return change.view(complex)[..., 0], uniform


def joined(loads: list[PointwiseLoad]) -> PointwiseLoad:
    """Trains one after the other: the axles of the first, then those of the second, and so on."""
    first = np.cumsum([0] + [len(load.kind) for load in loads])
    start = [load.start[:-1] + f for load, f in zip(loads, first[:-1], strict=True)]
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(load, name) for load in loads])
        for name in ("kind", "law", "mean", "response", "linear", "constant", "closes")
    }
    return replace(loads[0], start=np.concatenate([*start, first[-1:]]).astype(np.int32), **columns)


def tables(load: PointwiseLoad) -> tuple[np.ndarray, ...]:
    """The arrays in the order of the kernel's arguments, ``start`` to ``closes``."""
    angle = 2.0 * np.pi * np.arange(load.n_points) / load.n_points
    wave = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # Butterflies of the first pass from ``low`` to ``high`` take two modes at most.
    first, last = load.first_mode, load.first_mode + load.response.shape[1] - 1
    quarter = load.n_points // 4
    low, high = max(0, last + 1 - quarter), min(quarter, 2 * quarter - last)
    band = np.array([first, low, max(low, high)], dtype=np.int32)
    # By mode number, upwards and downwards; the factors of the modes that there are not are zero.
    # Mode 0, which no profile has, is 1 in the kernel: its factors are the means.
    response, half = np.zeros((len(load.kind), load.n_points // 2, 4)), load.n_points // 2
    response[:, 0, :2] = load.mean
    response[:, first : last + 1, :2] = load.response[..., :2]
    response[:, half - last : half - first + 1, 2:] = load.response[:, ::-1, 2:]
    arrays = (load.start, load.kind, load.law, response, load.linear, load.constant)
    return (*arrays, wave, band, load.closes)
