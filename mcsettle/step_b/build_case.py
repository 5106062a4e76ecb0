"""From a scene and its transfer functions to the case that an engine takes."""

from mcsettle.railway.scene import Scene
from mcsettle.step_a.transfers import StepA
from mcsettle.step_b.case import Case
from mcsettle.step_b.equivalent_cycles import with_equivalent_cycles


def build_case(scene: Scene, prepared: StepA) -> Case:
    """The engine's description of a scene."""
    transfers = prepared.transfers[scene.variant, scene.scenario]
    case = Case(
        timetable=scene.timetable,
        transfers=transfers,
        model=scene.settlement,
        window=scene.window,
        sd_limit=scene.sd_limit,
        horizon=scene.horizon,
        multipliers=scene.support.multipliers,
        following=transfers[0].following,
    )
    if scene.settlement.cycles != "equivalent":
        return case
    reference = None
    if scene.settlement.equivalence_history == "reference":
        reference = prepared.transfers[scene.variant, scene.reference_scenario][0]
    return with_equivalent_cycles(case, reference)
