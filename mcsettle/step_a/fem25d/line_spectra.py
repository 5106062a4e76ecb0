"""The response along one line ω = Ω + kv, over both signs of k, from the ground at few wavenumbers.

The ground is computed at the wavenumbers of the support; rail and pad, which vary faster, at every one
of the rule. A train asks for sums over k, Σ_q c_q f_q Σ_m P_qm S_m, with its own factors c, the force f
on a pad, the interpolation P and the outputs S of the ground. They are taken from the left,
Σ_m (Σ_q c_q f_q P_qm) S_m, so that the many outputs are never interpolated.

Rail (EI k⁴ - m ω²) and pad (p = k_p + iωc_p) join in closed form: with the support stiffness
S = 1/(1/p + H) a force F on one rail gives the rail F/(EI k⁴ - mω² + S) and the pad S times that. A unit
force per wheelset is F = 1/2 on each rail.

Below zero frequency the hysteretic moduli are conjugate: response(k, -ω) = conj response(-k, ω).
Outputs that are odd in k therefore change their sign with that of k and with that of the frequency.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mcsettle.railway.track import SectionTrack
from mcsettle.step_a.fem25d.wavenumber_rule import Quadrature, Support, jump_shares


@dataclass(frozen=True, eq=False)
class Part:
    """Wavenumbers of one sign at which the moduli are those of one sign of the frequency.

    ``nodes`` of the rule over k > 0; ``receptance`` [n] m/N·m and ``force`` [n] N/N on one pad under a
    unit force per wheelset there, times the part's share of them; ``ground`` [M, D] outputs at the
    support per unit pad force, at the frequency without sign. ``reverse``: k < 0; ``negative``: ω < 0.
    """

    nodes: slice
    receptance: np.ndarray
    force: np.ndarray
    ground: np.ndarray
    reverse: bool
    negative: bool

    def of(self, both_signs: np.ndarray) -> np.ndarray:
        """The part's share, a view, of an array [2 N, ...] over both signs of k."""
        half = both_signs.shape[0] // 2
        side = both_signs[half - 1 :: -1] if self.reverse else both_signs[half:]
        return side[self.nodes]

    def signed(self, outputs: np.ndarray, odd: int) -> np.ndarray:
        """``outputs`` [..., D], changed in place: the last ``odd`` ones with the sign of the part."""
        if self.reverse != self.negative:
            outputs[:, outputs.shape[1] - odd :] *= -1.0
        return outputs


@dataclass(frozen=True, eq=False)
class LineSpectra:
    """Response to a unit moving load at one (Ω, v): the ``Spectra`` of a section.

    ``wavenumbers``, ``weights`` and ``receptance`` [2 N] as in ``transfer.Spectra``. The ``parts`` add
    up to the D outputs, of which the last ``odd`` are odd in k.
    """

    wavenumbers: np.ndarray
    weights: np.ndarray
    receptance: np.ndarray
    parts: tuple[Part, ...]
    support: Support
    odd: int

    def outputs_under(self, factors: np.ndarray) -> np.ndarray:
        """Sums [J, D] of the outputs over the wavenumbers with ``factors`` [J, 2 N]."""
        total = np.zeros((factors.shape[0], self.parts[0].ground.shape[1]), dtype=np.complex128)
        for part in self.parts:
            at, gathered = self.support.gathered(part.of(factors.T).T * part.force, part.nodes)
            ground = part.ground[at]
            if part.negative:  # the smaller factor is the one to conjugate
                total += part.signed((gathered.conj() @ ground).conj(), self.odd)
            else:
                total += part.signed(gathered @ ground, self.odd)
        return total

    def stress_under(self, factors: np.ndarray) -> np.ndarray:
        """Sums [J, 4, Z] of the stresses over the wavenumbers with ``factors`` [J, 2 N]."""
        return self.outputs_under(factors).reshape(factors.shape[0], 4, -1)

    @cached_property
    def outputs(self) -> np.ndarray:
        """Outputs [2 N, D] at every wavenumber."""
        shape = self.wavenumbers.size, self.parts[0].ground.shape[1]
        values = np.zeros(shape, dtype=np.complex128)
        for part in self.parts:
            ground = self.support.spread(part.ground[None])[0][part.nodes]
            ground = (ground.conj() if part.negative else ground) * part.force[:, None]
            part.of(values)[:] += part.signed(ground, self.odd)
        return values

    @property
    def stress(self) -> np.ndarray:
        """Stress [2 N, 4, Z] Pa/N·m at every wavenumber."""
        return self.outputs.reshape(self.wavenumbers.size, 4, -1)


def line_spectra(
    track: SectionTrack,
    rule: tuple[Quadrature, Support],
    ground: tuple[np.ndarray, np.ndarray],
    foot: tuple[np.ndarray, np.ndarray],
    odd: int,
    speed: float,
    omega: float,
) -> LineSpectra:
    """Response at one driving frequency ``omega`` [rad/s] and ``speed`` [m/s].

    Parameters
    ----------
    track : SectionTrack
        Its rail and pad join the ground.
    rule : (Quadrature, Support)
        Wavenumbers k > 0 of the rule, N, and of the support, M.
    ground : two of np.ndarray
        Outputs [M, D] under a unit pad force, at ω = Ω + kv and at Ω - kv, which serves k < 0; both with
        the moduli of positive frequency.
    foot : two of np.ndarray
        Mean displacement under the rail foot [N] m/N·m at the same frequencies.
    odd : int
        Outputs, the last ones, that are odd in k.
    """
    quadrature, support = rule
    parts: list[Part] = []
    for reverse, velocity in ((False, speed), (True, -speed)):
        parts += _parts(track, quadrature, ground[reverse], foot[reverse], velocity, omega)
    k, weights = quadrature.both_signs
    receptance = np.zeros(k.size, dtype=np.complex128)
    for part in parts:
        part.of(receptance)[:] += part.receptance
    return LineSpectra(k, weights, receptance, tuple(parts), support, odd)


def _parts(
    track: SectionTrack,
    quadrature: Quadrature,
    ground: np.ndarray,
    foot: np.ndarray,
    velocity: float,
    omega: float,
) -> Iterator[Part]:
    """Wavenumbers of one sign, at ω = Ω + k ``velocity``, by the sign of the frequency."""
    k = quadrature.nodes
    frequency = omega + k * velocity
    cut = int(np.count_nonzero(frequency >= 0.0))
    above, below = slice(0, cut), slice(cut, k.size)
    share, rest = np.ones(k.size), np.ones(k.size)
    jump = jump_shares(quadrature, -omega / velocity) if omega > 0.0 > velocity else None
    if jump is not None:  # the damping changes sign inside this panel, which counts for both
        panel, shares = jump
        share[panel], rest[panel] = shares, 1.0 - shares
        above, below = slice(0, panel.stop), slice(panel.start, k.size)
    for nodes, weight, sign in ((above, share, 1.0), (below, rest, -1.0)):
        if nodes.start < nodes.stop:
            known = foot[nodes] if sign > 0.0 else foot[nodes].conj()
            receptance, force = rail_coupling(track, k[nodes], frequency[nodes], known, sign)
            w = weight[nodes]
            yield Part(nodes, w * receptance, w * force, ground, velocity < 0.0, sign < 0.0)


def rail_coupling(
    track: SectionTrack,
    k: np.ndarray,
    omega: np.ndarray,
    foot: np.ndarray,
    sign: np.ndarray | float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Rail receptance [m/N·m] and force on one pad [N/N] under a unit force per wheelset.

    ``foot`` is the mean displacement under the rail foot per unit pad force [m/N·m] at the
    wavenumbers ``k`` [rad/m] and frequencies ``omega`` [rad/s]; ``sign`` that of the frequency
    whose moduli are meant. All [N].
    """
    rail, pad = track.rail, track.pad
    factor = 2.0 if track.damping_convention == "damping_ratio" else 1.0
    bending = rail.bending_stiffness * (1.0 + 1j * factor * rail.damping * sign)
    free = bending * k**4 - rail.mass_per_length * omega**2
    support = 1.0 / (1.0 / (pad.stiffness + 1j * omega * pad.damping) + foot)
    receptance = 0.5 / (free + support)
    return receptance, support * receptance
