"""Table 4: by how many per cent faster trains raise the deviatoric stress, ours and published.

The paper gives one column for quasi-static and one for dynamic excitation "at subgrade surface" and
leaves open at which instant. Each is computed by two definitions, so that the choice can be judged.
The dynamic ones depend on the profile: their range over the study's realisations stands beside the
value for the spectrum.
"""

from dataclasses import dataclass, field

import numpy as np

OVERHEAD = "quasi-static, axle overhead"
LARGEST = "quasi-static, largest in passing"
DYNAMIC = "dynamic, stress alone"
CHANGE = "dynamic, change of total"
DEFINITIONS = {
    OVERHEAD: "σ_d of the quasi-static stress below an axle, mean over the train's axles",
    LARGEST: "largest σ_d of the quasi-static stress while the middle car passes",
    DYNAMIC: "σ_d of the dynamic stress by itself, rms over profile and axles",
    CHANGE: "change of σ_d about its quasi-static value, rms over profile and axles",
}
METRIC_OF = {
    OVERHEAD: "quasi_static_stress_increase_percent",
    LARGEST: "quasi_static_stress_increase_percent",
    DYNAMIC: "dynamic_stress_increase_percent",
    CHANGE: "dynamic_stress_increase_percent",
}
RANGE = (5.0, 95.0)  # percentiles over realisations
REALISATIONS = 1000  # from which they are taken


@dataclass(frozen=True)
class SurfaceStress:
    """σ_d at the subgrade surface for one scenario at ``speed`` [m/s], by definition.

    ``values`` Pa; ``samples`` [R] Pa, realisation by realisation, for those that depend on it.
    """

    scenario: str
    speed: float
    values: dict[str, float]
    samples: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Increase:
    """One entry of Table 4.

    ``stress`` [Pa] and its increase over the baseline, ``percent``; ``low`` and ``high`` [%], P5 and
    P95 of the increase over the realisations (equal to ``percent`` where they do not matter);
    ``published`` [%] and its ``source``.
    """

    scenario: str
    speed: float
    definition: str
    stress: float
    percent: float
    low: float
    high: float
    published: float | None
    source: str


def increases(
    stresses: list[SurfaceStress], published: dict[tuple[str, str], tuple[float, str]]
) -> list[Increase]:
    """Table 4 from the stresses of the scenarios, the baseline first.

    ``published``: (metric, scenario) -> (value [%], source), from the study's reference entries.
    """
    base = stresses[0]
    rows = []
    for definition in DEFINITIONS:
        for entry in stresses:
            percent = _percent(entry.values[definition], base.values[definition])
            low = high = percent
            if definition in entry.samples:
                spread = _percent(entry.samples[definition], base.samples[definition])
                low, high = np.percentile(spread, RANGE)
            value, source = published.get((METRIC_OF[definition], entry.scenario), (None, ""))
            rows.append(
                Increase(
                    entry.scenario,
                    entry.speed,
                    definition,
                    float(entry.values[definition]),
                    float(percent),
                    float(low),
                    float(high),
                    value,
                    source,
                )
            )
    return rows


def _percent(value: np.ndarray | float, base: np.ndarray | float) -> np.ndarray:
    return np.asarray(100.0 * (np.asarray(value) / base - 1.0))
