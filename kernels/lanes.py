"""State of realisations that are updated passage by passage, on tiles of lanes.

Realisations that have reached the limit are taken out and the others moved together as soon as that
empties a tile: tracks differ by a factor of four in how long they last, and idle lanes cost as much as
busy ones. The last tile becomes several small ones, so that no core waits for another. A lane's result
does not depend on its place, so moving changes nothing.
"""

from typing import Any

import numpy as np

from mcsettle.kernels import pointwise
from mcsettle.kernels.backend import ti
from mcsettle.kernels.burst import burst
from mcsettle.kernels.spectral import CAPACITY, LANES, Tables, workspace
from mcsettle.kernels.varying import fields_of, is_alike

KINDS = {"f64": np.float64, "f32": np.float32}
ROOM = 1 << 20  # coefficients that one launch adds up: they stay in the processor's cache
LAUNCH = 1e10  # floating-point operations in one launch: some tenths of a second on two cores


class March:
    """Up to CAPACITY realisations [R], of which the active ones occupy lanes; spectral growth.

    Parameters
    ----------
    amplitudes : complex [R, K], m
    power_limit : 2 sd_limit², m²
    tables : index tables of the pairs of modes, in the band and, where there are fields, beside it
    first : mode number of the band
    n_groups : settlement groups
    precision : "f64" or "f32"
    factor : [R] of each realisation's settlement; default 1
    following : [K] what the rail follows; default 1
    waves : [R, F M, 2] of the fields of susceptibility; default none
    multipliers : [F, G] of the fields in the groups
    """

    def __init__(
        self,
        amplitudes: np.ndarray,
        power_limit: float,
        tables: Tables,
        first: int,
        n_groups: int,
        precision: str = "f64",
        factor: np.ndarray | None = None,
        following: np.ndarray | None = None,
        waves: np.ndarray | None = None,
        multipliers: np.ndarray | None = None,
    ) -> None:
        n_real, n_modes = amplitudes.shape
        if n_real > CAPACITY:
            raise ValueError(f"{n_real} realisations; at most {CAPACITY} in one batch")
        self.power_limit, self.tables, self.n_groups = power_limit, tables, n_groups
        self.precision = precision
        self._factor = np.ones(n_real) if factor is None else np.asarray(factor, dtype=float)
        self.following = np.ones(n_modes) if following is None else following
        self.multipliers = np.zeros((1, n_groups)) if multipliers is None else multipliers
        self._waves, self.first = waves, first
        self._u = np.array(amplitudes, dtype=complex)
        self._active = np.sum(np.abs(amplitudes) ** 2, axis=1) < power_limit
        self._uniform = np.zeros(n_real)
        self._updates = np.zeros(n_real, dtype=np.int64)
        self._load(np.flatnonzero(self._active))

    @property
    def n_tiles(self) -> int:
        """Tiles in use."""
        return -(-len(self._rows) // self.lanes)

    def advance(self, load: np.ndarray, weights: np.ndarray, *coefficients: np.ndarray) -> None:
        """Apply the updates ``load`` [N] with ``weights`` [N, G] to every active realisation.

        ``coefficients``: what the updates apply, as the kernel takes it (spectral: form, constant and
        mean of ``burst``; pointwise: none, they are the march's tables).
        """
        self._check_owner()
        self._launch(load, weights, *coefficients)
        self._active[self._rows] = self._lanes(self.fields.state.factor) > 0.0
        busy = int(self._active.sum())
        if busy <= (self.n_tiles - 1) * self.lanes:
            self._store()
            self._load(np.flatnonzero(self._active))

    def _workspace(self, n_real: int) -> Any:
        """Room for so many realisations."""
        few, n_modes = n_real <= LANES[self.precision], self._u.shape[1]
        n_rows = 0 if self._waves is None else self._waves.shape[1]
        n_waves = 2 * (self.first + n_modes - 1) if n_rows else 0
        self.varying = fields_of(n_rows, n_waves, self.n_groups, self.precision, few)
        return workspace(n_modes, self.n_groups, self.precision, few)

    def _launch(self, load: np.ndarray, weights: np.ndarray, *coefficients: np.ndarray) -> None:
        w, varies = self.fields, self._waves is not None
        of_fields = weights[:, None, :] * self.multipliers if varies else weights[:, None][:, :0]
        every = np.ascontiguousarray(np.concatenate([weights[:, None], of_fields], axis=1))
        n_rows, n_parts, kind = coefficients[0].shape[2], every.shape[1], KINDS[self.precision]
        at_once = max(ROOM // (2 * n_rows * n_parts), 1)
        for begin in range(0, len(load), at_once):
            here = slice(begin, begin + at_once)
            n = len(load[here]) * n_parts
            added = np.empty((n, 2 * n_rows), kind), np.empty((n, 1 + len(self.following)))
            burst(
                load[here], every[here], *coefficients, *self.tables, self.following, self.first,
                self.power_limit, self.n_tiles, self.n_groups, varies, is_alike(self.multipliers),
                self.varying, w.state, *added,
            )  # fmt: skip

    def burst_size(self) -> int:
        """Updates per launch, so that progress and Ctrl-C work."""
        pairs = 2 * len(self.tables[0]) + len(self.tables[2])
        return max(16, int(LAUNCH / (max(self.n_tiles, 1) * self.lanes * 16 * pairs)))

    def amplitudes(self) -> np.ndarray:
        """Complex amplitudes [R, K], m."""
        self._store()
        return self._u.copy()

    def is_active(self) -> np.ndarray:
        """[R] realisations below the limit."""
        return self._active.copy()

    def any_active(self) -> bool:
        """Whether any realisation is still below the limit."""
        return bool(self._active.any())

    def updates(self) -> np.ndarray:
        """[R] updates applied to each realisation."""
        self._store()
        return self._updates.copy()

    def uniform(self) -> np.ndarray:
        """[R] uniform settlement, m."""
        self._store()
        return self._uniform.copy()

    def restore(
        self, amplitudes: np.ndarray, active: np.ndarray, updates: np.ndarray, uniform: np.ndarray
    ) -> None:
        """Go on from what ``amplitudes``, ``is_active``, ``updates`` and ``uniform`` gave."""
        self._u[:], self._active[:] = amplitudes, active
        self._updates[:], self._uniform[:] = updates, uniform
        self._load(np.flatnonzero(self._active))

    def _load(self, rows: np.ndarray) -> None:
        """Put the realisations ``rows`` into lanes, in order."""
        self._rows, self.fields = rows, self._workspace(len(rows))
        w, self.fields.owner[:] = self.fields.state, [self]
        self.lanes = w.u.shape[3]
        n_modes, u = self._u.shape[1], self._u[rows]
        room = np.zeros((len(rows), w.u.shape[1], 2))  # the field may hold more modes
        room[:, :n_modes, 0], room[:, :n_modes, 1] = u.real, u.imag
        w.u.from_numpy(self._tiled(room))
        self._copy(room)
        w.factor.from_numpy(self._tiled(self._active[rows] * self._factor[rows]))
        self._load_waves(rows)
        w.uniform.from_numpy(self._tiled(self._uniform[rows]))
        w.passages.from_numpy(self._tiled(self._updates[rows]))

    def _load_waves(self, rows: np.ndarray) -> None:
        """Put the fields of the realisations ``rows`` into their lanes."""
        if self._waves is not None:
            waves = self._tiled(self._waves[rows])
            self.varying.h.from_numpy(
                waves.astype(np.float32) if self.precision == "f32" else waves
            )

    def _copy(self, amplitudes: np.ndarray) -> None:
        """The copy of the state that single precision computes from."""
        if self.precision != "f64":
            self.fields.state.v.from_numpy(self._tiled(amplitudes.astype(np.float32)))

    def _store(self) -> None:
        """Bring the lanes' state back to their realisations."""
        rows, w = self._rows, self.fields.state
        self._check_owner()
        values = np.moveaxis(w.u.to_numpy(), -1, 1).reshape(w.u.shape[0] * self.lanes, -1, 2)
        values = values[: len(rows), : self._u.shape[1]]
        self._u[rows] = np.ascontiguousarray(values).view(complex)[..., 0]
        self._uniform[rows] = self._lanes(w.uniform)
        self._updates[rows] = self._lanes(w.passages)

    def _check_owner(self) -> None:
        if self.fields.owner != [self]:
            raise RuntimeError("another run has used these fields: advance one march at a time")

    def _tiled(self, rows: np.ndarray) -> np.ndarray:
        """[A, …] to [tiles, …, lanes], zero where there is no realisation."""
        full = np.zeros(
            (self.fields.state.u.shape[0] * self.lanes, *rows.shape[1:]), dtype=rows.dtype
        )
        full[: len(rows)] = rows
        tiles = full.reshape(-1, self.lanes, *rows.shape[1:])
        return np.ascontiguousarray(np.moveaxis(tiles, 1, -1))

    def _lanes(self, field: ti.Field) -> np.ndarray:
        return field.to_numpy().reshape(-1)[: len(self._rows)]


class PointwiseMarch(March):
    """The same with growth at every x and depth.

    ``tables`` are those of the pointwise kernel, ``waves`` its factors [R, P X] of the strain.
    """

    def burst_size(self) -> int:
        """Updates per launch, so that progress and Ctrl-C work."""
        start, kind, wave = (self.tables[i] for i in (0, 1, 6))
        transforms = len(kind) / (len(start) - 1)
        return max(
            16, int(LAUNCH / (max(self.n_tiles, 1) * self.lanes * 40 * transforms * len(wave)))
        )

    def _copy(self, amplitudes: np.ndarray) -> None:
        """None: the kernel takes the state up anew for every passage."""

    def _workspace(self, n_real: int) -> Any:
        """Room for CAPACITY realisations; the larger kernel is not compiled again for a few."""
        n_points = len(self.tables[6])
        n_factors = 0 if self._waves is None else self._waves.shape[1]
        w = pointwise.workspace(
            self._u.shape[1], n_points, self.n_groups, self.precision, n_factors
        )
        w.scratch.own.fill(1.0)
        return w

    def _load_waves(self, rows: np.ndarray) -> None:
        if self._waves is not None:
            self.fields.scratch.factors.from_numpy(self._tiled(self._waves[rows]))

    def _launch(self, load: np.ndarray, weights: np.ndarray, *coefficients: np.ndarray) -> None:
        w = self.fields
        pointwise.burst(
            load, weights, *self.tables, self.following, w.rows, w.scratch, 0, self.power_limit,
            self.n_tiles, self.n_groups, self._waves is not None, w.state,
        )  # fmt: skip
