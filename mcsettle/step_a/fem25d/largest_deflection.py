"""Critical speed of a track on its ground: where a constant moving load deflects the rail most.

The deflection at distance s from a unit load at speed v, (1/π) Re ∫ ũ(k, kv) e^{-iks} dk, grows as
v nears the smallest phase speed of the coupled waves of track and ground. The reduced bases cover
ω = kv at speeds above max_speed as long as ω ≤ max_omega + k max_speed: beyond that k the
rails' bending stiffness leaves nearly nothing of the load.
"""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from mcsettle.step_a.fem25d.cache import digest_of, read_arrays, write_arrays
from mcsettle.step_a.fem25d.moving_load import SectionResponse
from mcsettle.step_a.fem25d.wavenumber_rule import wavenumber_quadrature
from mcsettle.storage.files import cache_folder

SPEEDS = 15  # of the scan
LOWEST, HIGHEST = 0.6, 1.2  # of the scan, over the Rayleigh speed of the softest, the lowest layer
PANEL, POINTS = 0.4, 6  # rad/m and points of the quadrature: distances up to some 20 m
REACH = 15.0  # m ahead of and behind the load


@dataclass(frozen=True)
class CriticalSpeed:
    """Critical ``speed`` [m/s], and the deflections [m/N] from which it follows.

    ``speeds`` [V] m/s of the scan and the largest ``deflection`` [V] m/N of the rail at each.
    """

    speed: float
    speeds: np.ndarray
    deflection: np.ndarray


_computed: WeakKeyDictionary[SectionResponse, CriticalSpeed] = WeakKeyDictionary()


def critical_speed(response: SectionResponse) -> CriticalSpeed:
    """Speed at which the quasi-static deflection per load is largest.

    ``response`` is that of a track and its ground, softened or not. Remembered as long as the response
    exists, and stored on disk.
    """
    if response not in _computed:
        key = digest_of({"critical": response.digest, "scan": [SPEEDS, LOWEST, HIGHEST]})
        path = cache_folder() / f"critical-{key[:32]}.npz"
        critical = read_arrays(
            path,
            "critical speed",
            lambda a: CriticalSpeed(float(a["speed"]), a["speeds"], a["deflection"]),
        )
        if critical is None:
            critical = _critical_speed(response)
            arrays = {"speed": np.array(critical.speed), "speeds": critical.speeds}
            write_arrays(path, arrays | {"deflection": critical.deflection})
        _computed[response] = critical
    return _computed[response]


def _critical_speed(response: SectionResponse) -> CriticalSpeed:
    speeds = np.linspace(
        LOWEST * response.lowest_rayleigh_speed, HIGHEST * response.rayleigh_speed, SPEEDS
    )
    largest = deflections(response, speeds)
    at = int(np.argmax(largest))
    if not 0 < at < speeds.size - 1:
        return CriticalSpeed(float(speeds[at]), speeds, largest)
    # The top of the parabola through the largest value and its neighbours.
    before, peak, after = largest[at - 1 : at + 2]
    shift = 0.5 * (before - after) / (before - 2.0 * peak + after)
    return CriticalSpeed(float(speeds[at] + shift * (speeds[1] - speeds[0])), speeds, largest)


def deflections(response: SectionResponse, speeds: np.ndarray) -> np.ndarray:
    """Largest rail deflection [V] m/N within 15 m of a unit constant load at ``speeds`` [V] m/s."""
    s = response.settings
    excess = speeds.max() - s.max_speed
    limit = s.bands[-1] if excess <= 0.0 else min(s.bands[-1], s.max_omega / excess)
    rule = wavenumber_quadrature(limit, PANEL, POINTS)
    receptance = np.stack([response.at(float(k), k * speeds)[:, 0] for k in rule.nodes], axis=1)
    distance = np.linspace(-REACH, REACH, 401)
    waves = np.exp(-1j * np.outer(rule.nodes, distance)) * rule.weights[:, None] / np.pi
    return np.asarray(np.abs((receptance @ waves).real).max(axis=1))
