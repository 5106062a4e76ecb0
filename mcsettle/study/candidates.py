"""Parameter sets from which a surrogate of Step A may learn, however many of them are run."""

from dataclasses import dataclass

from mcsettle.railway.scene import Scene
from mcsettle.study.parameter_sets import CENTRAL, first_sets
from mcsettle.study.schema.step_a import StepATable
from mcsettle.study.study import Study

POOL = 512  # first draws


@dataclass(frozen=True, eq=False)
class Candidates:
    """Sets by ``indices`` and their ``scenes``; the first one is always learnt from.

    ``baseline``: scenario with which effects compare the others; ``digest`` of the study.
    """

    indices: tuple[int, ...]
    scenes: tuple[tuple[Scene, ...], ...]
    baseline: str
    digest: str
    table: StepATable


def candidates_of(study: Study) -> Candidates:
    """The study's own inputs and its first draws, or all of its grounds."""
    members, table = first_sets(study, POOL), study.step_a_table
    indices = [member.index for member in members]
    scenes = [member.scenes for member in members]
    if study.grounds_table is None:
        indices, scenes = [CENTRAL, *indices], [study.scenes, *scenes]
    baseline = study.reference_scenario
    return Candidates(tuple(indices), tuple(scenes), baseline, study.digest, table or StepATable())
