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
    from mcsettle.analysis.calibration import calibrate
    from mcsettle.analysis.track_summary import track_summary
    from mcsettle.economics import paired_effects
    from mcsettle.errors import InputError, MissingPrecomputationError, NumericalError
    from mcsettle.estimate.estimate import Estimate
    from mcsettle.railway.track import BeamTrack, Layer, Material, SectionTrack
    from mcsettle.railway.traffic import Service, Timetable, Train
    from mcsettle.railway.vehicle import Vehicle
    from mcsettle.report.notebook import plot, summarise
    from mcsettle.run.pipeline import run_study
    from mcsettle.step_a.transfer import TransferFunctions
    from mcsettle.study.study import Study, load_study, resolved_toml

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
    "analysis.calibration": ("calibrate",),
    "economics": ("paired_effects",),
    "errors": ("InputError", "MissingPrecomputationError", "NumericalError"),
    "estimate.estimate": ("Estimate",),
    "report.notebook": ("plot", "summarise"),
    "run.pipeline": ("run_study",),
    "study.study": ("Study", "load_study", "resolved_toml"),
    "railway.track": ("BeamTrack", "Layer", "Material", "SectionTrack"),
    "analysis.track_summary": ("track_summary",),
    "railway.traffic": ("Service", "Timetable", "Train"),
    "step_a.transfer": ("TransferFunctions",),
    "railway.vehicle": ("Vehicle",),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _MODULE:
        raise AttributeError(f"module 'mcsettle' has no attribute '{name}'")
    return getattr(import_module(f"mcsettle.{_MODULE[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
