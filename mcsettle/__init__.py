"""mcsettle: differential track settlement, tamping intervals and marginal tamping costs.

The tour: a study file becomes a frozen ``Study``, which builds the objects of the model.

>>> from mcsettle import Study
>>> study = Study.from_mapping(
...     {
...         "schema_version": 1,
...         "track": {"model": "beam"},
...         "profile": {"sd_mm": 1.03},
...         "limit": {"sd_limit_mm": 1.5},
...         "trains": {"passenger": {"vehicle": "passenger", "cars": 11}},
...         "scenarios": [
...             {
...                 "name": "v201",
...                 "timetable": [{"train": "passenger", "speed_kmh": 201, "per_day": 72}],
...             }
...         ],
...     }
... )
>>> study.timetable("v201").passages_per_day
3168
>>> round(study.timetable("v201").services[0].speed, 2)
55.83

``run_study`` takes such a study to a folder of Parquet tables, ``summarise`` reads them back as one
table and ``plot`` draws them; the objects print as what they are.

>>> print(study.timetable("v201"))
72 × passenger at 201 km/h
>>> print(study.trains["passenger"])
passenger: 11 cars, 44 axles, 748 t

Importing the package imports
neither Taichi nor NumPy: each name below is loaded when it is first used.

Depends on: nothing until a name is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcsettle.calibration import calibrate
    from mcsettle.economics import paired_effects
    from mcsettle.errors import InputError, MissingPrecomputationError, NumericalError
    from mcsettle.estimate import Estimate
    from mcsettle.notebook import plot, summarise
    from mcsettle.pipeline import run_study
    from mcsettle.study import Study, load_study, resolved_toml
    from mcsettle.track import BeamTrack, Layer, Material, SectionTrack
    from mcsettle.track_report import track_summary
    from mcsettle.traffic import Service, Timetable, Train
    from mcsettle.transfer import TransferFunctions
    from mcsettle.vehicle import Vehicle

__version__ = "0.1.0"
__all__ = [
    "BeamTrack",
    "Estimate",
    "InputError",
    "Layer",
    "Material",
    "MissingPrecomputationError",
    "NumericalError",
    "SectionTrack",
    "Service",
    "Study",
    "Timetable",
    "Train",
    "TransferFunctions",
    "Vehicle",
    "calibrate",
    "load_study",
    "paired_effects",
    "plot",
    "resolved_toml",
    "run_study",
    "summarise",
    "track_summary",
]

_HOME = {
    "calibration": ("calibrate",),
    "economics": ("paired_effects",),
    "errors": ("InputError", "MissingPrecomputationError", "NumericalError"),
    "estimate": ("Estimate",),
    "notebook": ("plot", "summarise"),
    "pipeline": ("run_study",),
    "study": ("Study", "load_study", "resolved_toml"),
    "track": ("BeamTrack", "Layer", "Material", "SectionTrack"),
    "track_report": ("track_summary",),
    "traffic": ("Service", "Timetable", "Train"),
    "transfer": ("TransferFunctions",),
    "vehicle": ("Vehicle",),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _MODULE:
        raise AttributeError(f"module 'mcsettle' has no attribute '{name}'")
    return getattr(import_module(f"mcsettle.{_MODULE[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
