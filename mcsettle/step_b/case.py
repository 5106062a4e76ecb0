"""One scenario as the engine sees it, and what became of its realisations."""

from dataclasses import dataclass

import numpy as np

from mcsettle.railway.scene import Scene
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.traffic import Timetable
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_a.transfers import StepA
from mcsettle.step_b.passage import mode_numbers
from mcsettle.step_b.spectral import ModePairs, mode_pairs


@dataclass(frozen=True)
class Case:
    """One scenario as the engine sees it, SI but for days.

    ``transfers``: one per service of the timetable. ``window`` m, ``sd_limit`` m, ``horizon`` days.
    """

    timetable: Timetable
    transfers: tuple[TransferFunctions, ...]
    model: SettlementModel
    window: float
    sd_limit: float
    horizon: float

    def __post_init__(self) -> None:
        if len(self.transfers) != len(self.timetable.services):
            raise ValueError("a case needs one set of transfer functions per service")

    @property
    def wavenumbers(self) -> np.ndarray:
        """Wavenumbers [K] rad/m of the profile's modes."""
        return self.transfers[0].wavenumbers

    @property
    def mode_pairs(self) -> ModePairs:
        """Pairs of modes that together make a third."""
        return mode_pairs(mode_numbers(self.wavenumbers, self.window))


@dataclass(frozen=True)
class Outcome:
    """What became of R realisations; NaN days where the limit was not reached.

    ``days`` [R] fractional days to the limit; ``passages`` [R] axle passages simulated; ``sd_initial``
    and ``sd_final`` [R] m; ``amplitudes`` complex [R, K] m at the end; ``mean_settlement`` [R] m;
    ``history`` [R, H] m at the sample days (NaN after the stop); ``reached``, ``failed`` [R];
    ``steps`` [R] integration steps (cycle jump) or updates.
    """

    reached: np.ndarray
    failed: np.ndarray
    days: np.ndarray
    passages: np.ndarray
    sd_initial: np.ndarray
    sd_final: np.ndarray
    mean_settlement: np.ndarray
    amplitudes: np.ndarray
    history: np.ndarray
    steps: np.ndarray


def build_case(scene: Scene, prepared: StepA) -> Case:
    """The engine's description of a scene."""
    return Case(
        timetable=scene.timetable,
        transfers=prepared.transfers[scene.variant, scene.scenario],
        model=scene.settlement,
        window=scene.window,
        sd_limit=scene.sd_limit,
        horizon=scene.horizon,
    )
