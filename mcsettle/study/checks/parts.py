"""What the checks of a study read: its tables as parsed, before anything is built."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from mcsettle.study.schema.economics import EconomicsTable, MaintenanceTable
from mcsettle.study.schema.profile import ProfileTable
from mcsettle.study.schema.published import CalibrationTable, ReferenceTable
from mcsettle.study.schema.run import LimitTable, RunTable
from mcsettle.study.schema.track import TrackTable
from mcsettle.study.schema.traffic import ScenarioTable, TrainTable, VehicleTable
from mcsettle.study.schema.variants import VariantTable


@dataclass(frozen=True)
class Parts:
    """The sound tables of a study; entries of lists keep their place in the file."""

    track: TrackTable | None = None
    profile: ProfileTable | None = None
    limit: LimitTable | None = None
    economics: EconomicsTable | None = None
    calibration: CalibrationTable | None = None
    run: RunTable | None = None
    maintenance: MaintenanceTable | None = None
    trains: Mapping[str, TrainTable] = field(default_factory=dict)
    vehicles: Mapping[str, VehicleTable] = field(default_factory=dict)
    train_names: tuple[str, ...] = ()
    scenario_names: tuple[str, ...] = ()
    variant_names: tuple[str, ...] = ()
    scenarios: Mapping[int, ScenarioTable] = field(default_factory=dict)
    variants: Mapping[int, VariantTable] = field(default_factory=dict)
    reference: Mapping[int, ReferenceTable] = field(default_factory=dict)
