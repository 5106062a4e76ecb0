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

Importing the package imports neither Taichi nor NumPy: each name below is loaded when first used.

Depends on: nothing until a name is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # the same names for type checkers, which cannot follow the table below
    from mcsettle.analysis.calibration import calibrate as calibrate
    from mcsettle.analysis.track_summary import track_summary as track_summary
    from mcsettle.economics import paired_effects as paired_effects
    from mcsettle.errors import InputError as InputError
    from mcsettle.errors import MissingPrecomputationError as MissingPrecomputationError
    from mcsettle.errors import NumericalError as NumericalError
    from mcsettle.estimate.estimate import Estimate as Estimate
    from mcsettle.railway.track import BeamTrack as BeamTrack
    from mcsettle.railway.track import Layer as Layer
    from mcsettle.railway.track import Material as Material
    from mcsettle.railway.track import SectionTrack as SectionTrack
    from mcsettle.railway.traffic import Service as Service
    from mcsettle.railway.traffic import Timetable as Timetable
    from mcsettle.railway.traffic import Train as Train
    from mcsettle.railway.vehicle import Vehicle as Vehicle
    from mcsettle.report.notebook import plot as plot
    from mcsettle.report.notebook import summarise as summarise
    from mcsettle.run.distributed import run_distributed as run_distributed
    from mcsettle.run.options import RunOptions as RunOptions
    from mcsettle.run.pipeline import run_study as run_study
    from mcsettle.step_a.transfer import TransferFunctions as TransferFunctions
    from mcsettle.study.study import Study as Study
    from mcsettle.study.study import load_study as load_study
    from mcsettle.study.study import resolved_toml as resolved_toml
    from mcsettle.summary.compare import compare as compare
    from mcsettle.summary.results import Results as Results
    from mcsettle.summary.results import read_results as read_results

    __version__: str

_NAMES = {
    "analysis.calibration": "calibrate",
    "analysis.track_summary": "track_summary",
    "economics": "paired_effects",
    "errors": "InputError MissingPrecomputationError NumericalError",
    "estimate.estimate": "Estimate",
    "railway.track": "BeamTrack Layer Material SectionTrack",
    "railway.traffic": "Service Timetable Train",
    "railway.vehicle": "Vehicle",
    "report.notebook": "plot summarise",
    "run.distributed": "run_distributed",
    "run.options": "RunOptions",
    "run.pipeline": "run_study",
    "step_a.transfer": "TransferFunctions",
    "study.study": "Study load_study resolved_toml",
    "summary.compare": "compare",
    "summary.results": "Results read_results",
}
_HOME = {name: f"mcsettle.{module}" for module, names in _NAMES.items() for name in names.split()}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("mcsettle")
    if name not in _HOME:
        raise AttributeError(f"module 'mcsettle' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
