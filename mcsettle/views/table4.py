"""Table 4: by how many per cent faster trains raise the deviatoric stress, ours and published.

The paper gives one column for quasi-static and one for dynamic excitation "at subgrade surface" and
leaves open at which instant. Three definitions are computed, so that the choice can be judged.

Depends on: views.stress.
"""

from dataclasses import dataclass

import numpy as np

OVERHEAD = "quasi-static, axle overhead"
LARGEST = "quasi-static, largest in passing"
DYNAMIC = "dynamic, rms over the profile"
DEFINITIONS = {
    OVERHEAD: "σ_d of the quasi-static stress below an axle, mean over the train's axles",
    LARGEST: "largest σ_d of the quasi-static stress while the middle car passes",
    DYNAMIC: "root mean square over profile and axles of σ_d of the dynamic stress alone",
}
METRIC_OF = {
    OVERHEAD: "quasi_static_stress_increase_percent",
    LARGEST: "quasi_static_stress_increase_percent",
    DYNAMIC: "dynamic_stress_increase_percent",
}


@dataclass(frozen=True)
class Increase:
    """One entry of Table 4: ``stress`` [Pa], its increase over the baseline [%], the published one."""

    scenario: str
    speed: float
    definition: str
    stress: float
    percent: float
    published: float | None
    source: str


@dataclass(frozen=True)
class SurfaceStress:
    """σ_d [Pa] at the subgrade surface for one scenario at ``speed`` [m/s], by definition."""

    scenario: str
    speed: float
    values: dict[str, float]


def increases(
    stresses: list[SurfaceStress], published: dict[tuple[str, str], tuple[float, str]]
) -> list[Increase]:
    """Table 4 from the stresses of the scenarios, the baseline first.

    ``published``: (metric, scenario) -> (value [%], source), from the study's reference entries.
    """
    base = stresses[0].values
    rows = []
    for definition in DEFINITIONS:
        for entry in stresses:
            value, source = published.get((METRIC_OF[definition], entry.scenario), (None, ""))
            percent = 100.0 * (entry.values[definition] / base[definition] - 1.0)
            rows.append(
                Increase(
                    entry.scenario,
                    entry.speed,
                    definition,
                    float(entry.values[definition]),
                    float(np.round(percent, 12)),
                    value,
                    source,
                )
            )
    return rows
