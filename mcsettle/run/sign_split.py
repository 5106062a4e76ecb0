"""The table ``sign_split``: what added services roughen and harden, by experiment on the first tracks.

A study with parameter sets is split at its own values alone. The rows depend on nothing but the study, so
whoever closes the run writes the same bytes.
"""

from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import groupby
from typing import Any

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.scene import Scene
from mcsettle.run.columns import joined
from mcsettle.step_a.processes import ALONE, Together
from mcsettle.step_a.transfers import StepA, step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import support_of
from mcsettle.step_b.cycle_jump import Forms
from mcsettle.step_b.sign_split import joined_traffic, sign_split
from mcsettle.storage import parquet, store
from mcsettle.storage.location import Place
from mcsettle.storage.provenance import Provenance
from mcsettle.study.run_inputs import RunInputs

PAIRS = 64  # tracks of each scenario, fewer where the run has fewer
TABLE, NAME = "sign_split", "sign_split.parquet"


def write_sign_split(
    at: Place,
    run: RunInputs,
    provenance: Provenance,
    prepared: StepA | None = None,
    processes: Together = ALONE,
) -> None:
    """Write the table, if a scenario adds services to the baseline; what is there already stays.

    ``prepared``: Step A of the central set; None: from the cache folder, or computed. ``processes``
    share the variants.
    """
    if not run.effects:
        return
    scenes = run.central.scenes
    pairs = _pairs(scenes, run.effects)
    n = min(run.extent.realisations, PAIRS)
    if pairs and _is_written(at, provenance, n):
        return
    at.remove(f"{TABLE}/{NAME}")
    if not pairs:
        return
    prepared = prepared or step_a(scenes)
    tasks = [
        (list(of_variant), prepared.of_variant(variant), range(n))
        for variant, of_variant in groupby(pairs, key=lambda pair: pair[0].variant)
    ]
    parts = [part for of in processes.map(_of_variant, tasks) for part in of]
    store.write(at, TABLE, NAME, joined(parts), provenance, 0, n - 1)


def _of_variant(
    pairs: list[tuple[Scene, Scene]], prepared: StepA, indices: range
) -> list[dict[str, Any]]:
    """Rows of every pair of baseline and scenario of one variant."""
    forms: Forms = {}  # of the trains, which the scenarios of a variant share
    return [_columns(base, other, prepared, indices, forms) for base, other in pairs]


def _pairs(
    scenes: Sequence[Scene], effects: Sequence[tuple[str, str]]
) -> list[tuple[Scene, Scene]]:
    """Baseline and scenario of every variant and effect that can be split."""
    by_name = {(scene.variant, scene.scenario): scene for scene in scenes}
    pairs = []
    for variant in dict.fromkeys(scene.variant for scene in scenes):
        for baseline, scenario in effects:
            base, scene = by_name[variant, baseline], by_name[variant, scenario]
            model = scene.settlement
            # Where N before counts the scenario's own mix it cannot be held while the traffic changes.
            held = model.cycles != "equivalent" or model.equivalence_history != "mix"
            if held and _adds(base, scene):
                pairs.append((base, scene))
    return pairs


def _adds(base: Scene, other: Scene) -> bool:
    """Whether a scenario has services that the baseline has not, or not as often."""
    trains: dict[Any, int] = {}
    for sign, scene in ((-1, base), (1, other)):
        for s in scene.timetable.services:
            trains[s.train, s.speed] = trains.get((s.train, s.speed), 0) + sign * s.per_day
    return any(n > 0 for n in trains.values())


def _columns(
    base: Scene, other: Scene, prepared: StepA, indices: range, forms: Forms
) -> dict[str, Any]:
    """Rows of one scenario in one variant."""
    of_base, of_other = ((s.variant, s.scenario) for s in (base, other))
    traffic = joined_traffic(
        list(zip(base.timetable.services, prepared.transfers[of_base], strict=True)),
        list(zip(other.timetable.services, prepared.transfers[of_other], strict=True)),
    )
    scene = replace(other, timetable=traffic.timetable)
    case = build_case(scene, StepA({**prepared.transfers, of_other: traffic.transfers}))
    profiles = scene.profiles.sample(indices)
    split = sign_split(case, traffic, profiles, support_of(scene, indices, profiles), forms)
    n = len(indices)
    return {
        "variant": [scene.variant] * n,
        "scenario": [scene.scenario] * n,
        "baseline": [base.scenario] * n,
        "realisation": np.arange(n) + indices.start,
        "status": ["censored" if np.isnan(v) else "paired" for v in split.reduction],
        "reduction_percent": split.reduction,
        "reduction_by_roughening_percent": split.by_roughening,
        "reduction_by_hardening_percent": split.by_hardening,
        "roughening_ratio": split.roughening,
        "break_even_ratio": split.break_even,
        "leverage": split.leverage,
    }


def _is_written(at: Place, provenance: Provenance, n: int) -> bool:
    """Whether the table is there, of this run and of ``n`` tracks."""
    try:
        stored = parquet.decode(at.read(f"{TABLE}/{NAME}"), NAME).schema.metadata or {}
    except (FileNotFoundError, InputError):
        return False
    wanted = {key: str(value) for key, value in asdict(provenance).items()}
    wanted["index_range"] = f"0-{n - 1}"
    return {key.decode(): value.decode() for key, value in stored.items()} == wanted
