"""The simplified track: rails on a continuous elastic layer, in closed form.

Both rails are one Euler–Bernoulli beam 2EI of mass 2m on a Winkler layer of stiffness 2s. A unit
load per wheelset, moving at v and oscillating at Ω, gives in the wavenumber domain (ω = Ω + kv)

    ũ(k, ω) = 1 / 2[EI k⁴ - m ω² + s (1 + iη sgn ω)].

The reaction 2s(1 + iη sgn ω) ũ, spread over the sleeper length, loads a homogeneous elastic
half-space (``halfspace``), whose static stresses are taken below the track centreline.

The integral over k uses the trapezoidal rule: the response is analytic in a strip around the real
axis, so the rule converges exponentially and its only error in the spacing is that the load repeats
every ``period`` metres, which must be longer than the train. Gauss points would need three times as
many to resolve the waves e^{-iks} between the ends of a long train.
"""

import hashlib
import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from mcsettle.errors import InputError, check_positive
from mcsettle.railway.track import BeamTrack, Layer, depth_below_subgrade
from mcsettle.step_a.depths import geostatic_stress, layer_quadrature
from mcsettle.step_a.halfspace import strip_stress
from mcsettle.step_a.transfer import DepthGrid, WavenumberSpectra

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

PERIOD = 700.0  # m, longer than the longest train (556 m) by the reach of its stresses
CUTOFF = 30.0  # rad/m; what lies beyond adds 8e-5 of the rail deflection
POINTS_PER_PANEL = 4  # Gauss points over each panel of depth: layer strains to 2e-5
PANEL_HEIGHT = 1.0  # m, upper bound of a panel's height


@dataclass(frozen=True)
class BeamResponse:
    """Step A of a beam track; make it with ``beam_response``.

    ``wavenumbers`` [Q] rad/m, evenly spaced and symmetric; ``kernel`` [Q, 4, Z] Pa per N/m of
    reaction. Implements ``transfer.TrackResponse``.
    """

    track: BeamTrack
    grid: DepthGrid
    geostatic: Array
    wavenumbers: Array
    kernel: ComplexArray
    digest: str

    @property
    def rayleigh_speed(self) -> float:
        """Critical speed of the beam on its support, (4 s EI / m²)^¼ [m/s].

        It plays the part of the ground's Rayleigh speed: past it a constant load radiates waves.
        """
        rail, support = self.track.rail, self.track.support_stiffness
        return float((4.0 * support * rail.bending_stiffness / rail.mass_per_length**2) ** 0.25)

    @property
    def rail_bending_stiffness(self) -> float:
        """EI of one rail [N m²]."""
        return self.track.rail.bending_stiffness

    def standing(self, wavenumbers: Array) -> tuple[Array, ComplexArray]:
        """Response to a standing load at ``wavenumbers`` [K] rad/m; see ``TrackResponse``."""
        k, s = np.asarray(wavenumbers, dtype=float), self.track.support_stiffness
        receptance = 0.5 / (self.rail_bending_stiffness * k**4 + s)
        kernel = reaction_stress(self.track, self.grid, k)
        return receptance, 2.0 * s * receptance[:, None, None] * kernel

    def spectra(self, speed: float, omegas: Array) -> Iterator[WavenumberSpectra]:
        """Spectra at ``speed`` [m/s] for each Ω of ``omegas`` [rad/s]; see ``TrackResponse``.

        Raises
        ------
        ValueError
            If the speed is not positive, or waves would travel along the beam.
        """
        check_positive("speed", speed, "m/s")
        k = self.wavenumbers
        weights = np.full(k.size, k[1] - k[0])
        for omega in omegas:
            receptance, reaction = beam_spectrum(self.track, k, speed, float(omega))
            yield WavenumberSpectra(k, weights, receptance, reaction[:, None, None] * self.kernel)


def beam_response(
    track: BeamTrack, integration_depth: float = 5.5, period: float = PERIOD, cutoff: float = CUTOFF
) -> BeamResponse:
    """Step A of the simplified track.

    Parameters
    ----------
    track
        Rails, support, sleeper length and the layers that carry the settlement laws.
    integration_depth
        Depth below the subgrade surface down to which stresses are given [m].
    period
        Distance after which the load repeats [m]: more than the longest train's length.
    cutoff
        Largest wavenumber [rad/m].

    Raises
    ------
    ValueError
        If a number is not positive or the layers end above the integration depth.
    """
    settings = {"integration_depth": integration_depth, "period": period, "cutoff": cutoff}
    for name, value in settings.items():
        check_positive(name, value)
    grid = depth_grid(track.layers, integration_depth)
    count = math.ceil(cutoff * period / (2.0 * math.pi))
    positive = np.arange(count + 1, dtype=np.float64) * (2.0 * math.pi / period)
    half = reaction_stress(track, grid, positive)
    description = {
        "model": "beam",
        "track": asdict(track),
        "settings": settings,
        "quadrature": [POINTS_PER_PANEL, PANEL_HEIGHT],
    }
    return BeamResponse(
        track=track,
        grid=grid,
        geostatic=geostatic_stress(track.layers, grid),
        wavenumbers=np.concatenate([-positive[:0:-1], positive]),
        kernel=np.concatenate([half[:0:-1].conj(), half]),
        digest=hashlib.sha256(json.dumps(description, sort_keys=True).encode()).hexdigest(),
    )


def reaction_stress(track: BeamTrack, grid: DepthGrid, wavenumbers: Array) -> ComplexArray:
    """Stress [Q, 4, Z] Pa per N/m of reaction, spread over the sleepers, at ``wavenumbers`` [Q]."""
    depths = depth_below_subgrade(track.layers) - grid.z
    columns = [strip_stress(wavenumbers, d, track.sleeper_length, track.poisson) for d in depths]
    return np.stack(columns, axis=-1)


def beam_spectrum(
    track: BeamTrack, wavenumbers: Array, speed: float, omega: float
) -> tuple[ComplexArray, ComplexArray]:
    """Receptance ũ [m/N·m] and support reaction [N/m per N·m] of both rails, shape [Q] each.

    The loss factors of support and rail change sign with ω = Ω + kv. In the one cell of the (evenly
    spaced) wavenumbers where that happens, the mean of both sides by their share of the cell is
    taken, which keeps the trapezoidal rule second order there.

    Raises
    ------
    InputError
        If waves would travel along the beam (speed or frequency too high).
    """
    rail, support = track.rail, track.support_stiffness
    total = omega + wavenumbers * speed
    bending = rail.bending_stiffness * wavenumbers**4
    elastic = bending - rail.mass_per_length * total**2 + support
    if np.min(elastic) <= 0.0:
        raise InputError(
            f"at {speed} m/s and {omega} rad/s waves travel along the beam; the simplified track "
            "serves lower speeds and frequencies only"
        )
    loss = bending * rail.damping + support * track.support_damping
    cell = speed * (wavenumbers[1] - wavenumbers[0])
    share = np.clip(0.5 + total / cell, 0.0, 1.0)
    reaction, receptance = np.zeros_like(total, dtype=complex), np.zeros_like(total, dtype=complex)
    for part, sign in ((share, 1.0), (1.0 - share, -1.0)):
        side = part / (2.0 * (elastic + 1j * sign * loss))
        receptance += side
        reaction += 2.0 * support * (1.0 + 1j * sign * track.support_damping) * side
    return receptance, reaction


def depth_grid(layers: tuple[Layer, ...], integration_depth: float) -> DepthGrid:
    """Composite Gauss–Legendre depths, in every layer panels of one height of at most 1 m.

    Raises
    ------
    ValueError
        If the layers end above ``integration_depth`` [m] below the subgrade surface.
    """
    lowest = depth_below_subgrade(layers) - sum(layer.height for layer in layers)
    if lowest > -integration_depth * (1.0 - 1e-12):
        raise ValueError(
            f"the layers end {-lowest} m below the subgrade surface, above the integration depth of "
            f"{integration_depth} m"
        )
    return layer_quadrature(layers, integration_depth, _panels, POINTS_PER_PANEL)


def _panels(layer: Layer, upper: float, lower: float) -> tuple[Array, Array]:
    """Middles and half heights [P] m of the panels of one layer."""
    edges = np.linspace(upper, lower, math.ceil((upper - lower) / PANEL_HEIGHT) + 1)
    half = (edges[0] - edges[1]) / 2.0
    return edges[:-1] - half, np.full(edges.size - 1, half)
