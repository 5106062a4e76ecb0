"""One variant and scenario of a study, as Steps A and B take it: neither ever sees a study."""

from dataclasses import dataclass

import numpy as np

from mcsettle.railway.initial_profiles import InitialProfiles
from mcsettle.railway.rail_loads import HALF, RailLoads
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.softening_choices import Softened, SofteningSettings
from mcsettle.railway.spatial_variability import UNIFORM, SupportVariation
from mcsettle.railway.track import Track
from mcsettle.railway.traffic import Service, Timetable


@dataclass(frozen=True, eq=False)
class Scene:
    """One variant and scenario, SI but for days.

    ``contact``: Hertzian stiffness N/m; ``integration_depth`` m below the subgrade surface;
    ``softening``: None where the soil is linear; ``sd_limit`` m; ``horizon`` and ``sample_days`` d;
    ``stepping``, ``right_hand_side`` and ``precision`` as ``step_b.engine`` takes them; ``support``: how
    it differs along and between sections; ``reference_scenario``: its first service is the reference of
    equivalent cycles.
    """

    variant: str
    scenario: str
    track: Track
    timetable: Timetable
    settlement: SettlementModel
    integration_depth: float
    softening: SofteningSettings | None
    contact: float
    profiles: InitialProfiles
    sd_limit: float
    horizon: float
    sample_days: np.ndarray
    stepping: str
    right_hand_side: str
    precision: str
    rail_loads: RailLoads = HALF
    support: SupportVariation = UNIFORM
    reference_scenario: str = ""

    @property
    def wavenumbers(self) -> np.ndarray:
        """Wavenumbers [K] rad/m of the profile's modes."""
        return self.profiles.wavenumbers

    @property
    def window(self) -> float:
        """Length of the periodic window, m."""
        return self.profiles.window

    def softened(self, service: Service) -> Softened | None:
        """What softens the ground under ``service``; None where the soil is linear."""
        if self.softening is None:
            return None
        return Softened(service.train, service.speed, self.softening)
