"""One track followed again from its address: profiles at the limit, a few days of mixed traffic.

A run keeps no profiles. The same (seed, index) gives the same track, so what a picture needs of one
is computed again from the study and Step A, in a moment.
"""

from dataclasses import replace

import numpy as np

from mcsettle.railway.irregularity import to_space
from mcsettle.report.figures.results import MixedDays, Profile
from mcsettle.report.material import Material
from mcsettle.step_a.transfers import StepA
from mcsettle.step_b import engine
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Case, Support, support_of
from mcsettle.units import MM

TRACK = 0  # the realisation that the pictures follow
MIXED_FROM, MIXED_DAYS, MIXED_POINTS = 2.0, 2.0, 400
MOST_PANELS = 6


def profiles_at_limit(material: Material, prepared: StepA) -> list[Profile]:
    """The track ``TRACK`` before traffic and when it ends, in each scenario of the answer's variant."""
    study = material.study
    modes = study.wavenumbers
    x = np.linspace(0.0, min(study.profile.window_m, 200.0), 801)
    profiles = []
    for scenario in study.scenario_names[:MOST_PANELS]:
        case, amplitudes, support = _case_of(material, scenario, prepared)
        outcome = engine.engine_for(case).run(amplitudes, np.zeros(0), support=support)
        if outcome.failed[0]:
            continue
        days = float(outcome.days[0]) if outcome.reached[0] else None
        initial, final = (to_space(a, modes, x)[0] / MM for a in (amplitudes, outcome.amplitudes))
        profiles.append(Profile(material.title(scenario), x, initial, final, days))
    return profiles


def _case_of(
    material: Material, scenario: str, prepared: StepA
) -> tuple[Case, np.ndarray, Support]:
    """What Step B takes of the track ``TRACK``: the case, its profile [1, K] m, its support."""
    scene, indices = material.study.scene(material.variant, scenario), range(TRACK, TRACK + 1)
    amplitudes = scene.profiles.sample(indices)
    return build_case(scene, prepared), amplitudes, support_of(scene, indices, amplitudes)


def mixed_scenario(material: Material) -> str | None:
    """The scenario with the most services of different trains; None without mixed traffic."""
    counts = {s.name: len({e.train for e in s.timetable}) for s in material.study.scenarios}
    # Of equal ones the last: the paper draws its heaviest.
    best = max(reversed(counts), key=lambda name: counts[name])
    return best if counts[best] > 1 else None


def mixed_days(material: Material, scenario: str, prepared: StepA) -> MixedDays | None:
    """SD of the track ``TRACK`` after every axle passage over two days of mixed traffic.

    None where passage-by-passage stepping does not exist (windows of 400 m and more) or the track is
    tamped before.
    """
    if material.study.profile.window_m >= 400.0:
        return None
    last = MIXED_FROM + MIXED_DAYS
    case, amplitudes, support = _case_of(material, scenario, prepared)
    case = replace(case, horizon=last)
    days = np.linspace(MIXED_FROM, last, MIXED_POINTS + 1)
    outcome = engine.engine_for(case, "every_axle").run(amplitudes, days, support=support)
    sd = outcome.history[0] / MM
    if outcome.failed[0] or np.isnan(sd).any():
        return None
    return MixedDays(days, sd, _blocks(case, MIXED_FROM, last))


def _blocks(case: Case, first: float, last: float) -> tuple[tuple[str, float, float], ...]:
    """Which service runs when: its share of the day is its share of the passages."""
    per_day = case.timetable.passages_per_day
    blocks = []
    for day in range(int(first), int(np.ceil(last))):
        begin = float(day)
        for service in case.timetable.services:
            end = begin + service.per_day * service.train.n_axles / per_day
            if end > first and begin < last:
                blocks.append((service.train.name, max(begin, first), min(end, last)))
            begin = end
    return tuple(blocks)
