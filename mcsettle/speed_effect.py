"""How the deviatoric stress in the ground grows with speed (Table 4), by stated definitions.

The paper gives "mean deviatoric stress at subgrade surface" without saying when and where along the
train it is taken. Here, at every depth on the centreline:

* ``overhead``: σ_d of the quasi-static stress below an axle, mean over the train's axles;
* ``largest``: largest quasi-static σ_d along the train;
* ``mean``: mean of the quasi-static σ_d from the first axle to the last;
* ``dynamic``: σ_d of the dynamic stress alone below an axle, root mean square over the random
  profile and the axles.

Depends on: interaction, stress, traffic, transfer.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mcsettle.interaction import precompute
from mcsettle.stress import DEVIATOR, deviatoric_stress
from mcsettle.traffic import Train
from mcsettle.transfer import DepthGrid, TrackResponse, WavenumberSpectra

DEFINITIONS = ("overhead", "largest", "mean", "dynamic")
STEP = 0.2  # m between places along the train


@dataclass(frozen=True)
class SpeedEffect:
    """σ_d by definition at S speeds and Z depths: ``stress[definition]`` [S, Z] Pa.

    ``speeds`` [S] m/s; ``grid`` the depths.
    """

    speeds: np.ndarray
    grid: DepthGrid
    stress: dict[str, np.ndarray]

    def percent(self, definition: str) -> np.ndarray:
        """Increase over the first speed [S, Z] %."""
        values = self.stress[definition]
        return np.asarray(100.0 * (values / values[0] - 1.0))


def speed_effect_on_stress(
    response_at: Callable[[float], TrackResponse],
    train: Train,
    speeds: Sequence[float],
    wavenumbers: np.ndarray,
    power: np.ndarray,
) -> SpeedEffect:
    """Deviatoric stress over depth at several speeds.

    Parameters
    ----------
    response_at : callable
        Step A at a speed [m/s] (the same for all speeds where the soil is linear).
    train : Train
        The train; all of its axles act.
    speeds : sequence of float
        Speeds [m/s]; increases are taken over the first.
    wavenumbers, power : np.ndarray
        [K] rad/m of the profile's modes and their share in its variance [m²].

    Raises
    ------
    ValueError
        If no speed is given.
    """
    if len(speeds) == 0:
        raise ValueError("no speed is given; at least one is needed")
    rows: dict[str, list[np.ndarray]] = {name: [] for name in DEFINITIONS}
    for speed in speeds:
        response = response_at(speed)
        transfer = precompute(train, speed, response, wavenumbers)
        overhead = deviatoric_stress(*transfer.quasi_static.transpose(1, 0, 2))
        along = _along(next(response.spectra(speed, np.zeros(1))), train)
        squares = np.abs(np.einsum("dc,jkcz->jkdz", DEVIATOR, transfer.dynamic)) ** 2
        variance = np.einsum("jkdz,k->jz", squares, power)
        rows["overhead"].append(overhead.mean(axis=0))
        rows["largest"].append(along.max(axis=0))
        rows["mean"].append(along.mean(axis=0))
        rows["dynamic"].append(np.sqrt(variance.mean(axis=0)))
    stress = {name: np.array(values) for name, values in rows.items()}
    return SpeedEffect(np.array(speeds), response.grid, stress)


def _along(spectra: WavenumberSpectra, train: Train) -> np.ndarray:
    """Quasi-static σ_d [X, Z] Pa at places from the last axle to the first."""
    axles = train.axle_positions
    x = np.arange(axles.min(), axles.max() + STEP / 2.0, STEP)
    k = spectra.wavenumbers
    load = np.exp(1j * np.outer(k, axles)) @ train.axle_forces * spectra.weights / (2.0 * np.pi)
    flat = spectra.stress.reshape(k.size, -1) * load[:, None]
    stress = (np.exp(-1j * np.outer(x, k)) @ flat).real.reshape(x.size, 4, -1)
    return deviatoric_stress(*stress.transpose(1, 0, 2))
