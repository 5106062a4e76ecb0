"""Draws of a study's uncertain inputs: parameter set e is row e of one scrambled Sobol sequence.

A row is an address, not a draw: it depends on the study's seed, its uncertain inputs and e alone, so
more sets leave the earlier ones as they are, and scenarios and variants share them.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.ground_profiles import Ground, slab_materials, slabs
from mcsettle.railway.scene import Scene
from mcsettle.study.schema.grounds import GroundsTable
from mcsettle.study.study import Study
from mcsettle.study.uncertain import normal_scores_correlation

CENTRAL = -1  # index of the study's own inputs among its sets
STREAM = 0x50BA1  # keeps these draws apart from those of the profiles
LARGEST_SEQUENCE = 2**20


@dataclass(frozen=True)
class ParameterSet:
    """One draw: ``values`` by key path (in the unit of the key), and the study that has them.

    ``shares`` are the cumulative probabilities drawn, by input; ``failure``: why it cannot be run, if it
    cannot; ``drawn_from``: the study whose inputs are uncertain.
    """

    index: int
    values: dict[str, float]
    study: Study
    shares: dict[str, float] = field(default_factory=dict)
    failure: str = ""
    drawn_from: Study | None = None

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The scene of every variant and scenario, variants outermost."""
        return self.study.scenes

    def with_values(self, values: dict[str, float]) -> "ParameterSet":
        """The set with some of its drawn values replaced; what is no input of the study stays."""
        assert self.drawn_from is not None
        replaced = self.values | values
        drawn = {path for entry in self.drawn_from.uncertain for path in entry.paths}
        inputs = {path: value for path, value in replaced.items() if path in drawn}
        return replace(self, values=replaced, study=self.drawn_from.with_inputs(inputs))


def unit_draws(study: Study, n_sets: int | None = None) -> np.ndarray:
    """Cumulative probabilities [E, D] of the draws, correlated as the study asks for."""
    from scipy import special, stats

    n, n_inputs = study.n_sets if n_sets is None else n_sets, len(study.uncertain)
    if n > LARGEST_SEQUENCE:
        raise InputError(f"{n} parameter sets; at most {LARGEST_SEQUENCE}")
    rng = np.random.default_rng([STREAM, study.seed])
    sobol = stats.qmc.Sobol(n_inputs, scramble=True, rng=rng)
    shares = sobol.random_base2(max(0, int(n - 1).bit_length()))[:n]
    shares = np.clip(shares, 1e-9, 1.0 - 1e-9)
    if not study.correlations:
        return shares
    names = [entry.input for entry in study.uncertain]
    root = np.linalg.cholesky(normal_scores_correlation(names, study.correlations))
    return np.asarray(special.ndtr(special.ndtri(shares) @ root.T))


def draws(study: Study, n_sets: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """``unit_draws``, and the values [E, D] of the uncertain inputs, in the order of the file."""
    shares = unit_draws(study, n_sets)
    columns = [entry.built().quantile(shares[:, d]) for d, entry in enumerate(study.uncertain)]
    return shares, np.stack(columns, axis=1)


def all_sets(study: Study) -> list[ParameterSet]:
    """Every parameter set of ``study``; without uncertain inputs one, the study itself.

    Raises
    ------
    InputError
        A draw that the study would refuse (inputs that are each possible may not be together).
    """
    if study.grounds_table is not None:
        return ground_sets(study)
    if not study.uncertain:
        return [ParameterSet(0, {}, study)]
    pairs = zip(*draws(study), strict=True)
    return [_parameter_set(study, e, *pair) for e, pair in enumerate(pairs)]


def first_sets(study: Study, n_sets: int) -> list[ParameterSet]:
    """The first ``n_sets`` draws, or all grounds, of ``study``, however many it runs.

    Those that cannot be run are left out.
    """
    if study.grounds_table is not None:
        every = study.with_run(parameter_sets=len(study.grounds()))
        return [member for member in ground_sets(every) if not member.failure]
    members = []
    for index, pair in enumerate(zip(*draws(study, n_sets), strict=True)):
        with suppress(InputError):
            members.append(_parameter_set(study, index, *pair))
    return members


def _parameter_set(study: Study, index: int, shares: np.ndarray, row: np.ndarray) -> ParameterSet:
    names = [entry.input for entry in study.uncertain]
    drawn = dict(zip(names, shares.tolist(), strict=True))
    values = {
        path: float(value)
        for entry, value in zip(study.uncertain, row, strict=True)
        for path in entry.paths
    }
    try:
        return ParameterSet(index, values, study.with_inputs(values), drawn, drawn_from=study)
    except InputError as error:
        reason = "\n".join(str(error).splitlines()[1:])
        raise InputError(
            f"parameter set {index} cannot be used:\n{reason}\n"
            "narrow the distributions that lead there, or correlate them"
        ) from None


def same_step_b(members: Sequence[ParameterSet]) -> dict[tuple[int, str, str], int]:
    """For every parameter set, variant and scenario the first set with the same rows of Step B."""
    first: dict[tuple[str, str, str], int] = {}
    same = {}
    for member in members:
        for variant in member.study.variant_names:
            for scenario in member.study.scenario_names:
                key = member.failure or member.study.step_b_key(variant, scenario)
                index = first.setdefault((variant, scenario, key), member.index)
                same[member.index, variant, scenario] = index
    return same


LAW = ("settlement_a", "settlement_b", "settlement_m", "strength_pa")
MATERIAL = ("youngs_modulus_pa", "poisson", "density_kg_per_m3", "damping", "k0")


def ground_sets(study: Study) -> list[ParameterSet]:
    """One parameter set for each ground of ``study``, as many as it asks for.

    A ground that cannot be run has its reason in ``failure`` and the study's own track.
    """
    segments: dict[str, int] = {}
    members = []
    for index, ground in enumerate(study.grounds()[: study.n_sets]):
        number = segments.setdefault(ground.segment, len(segments) + 1)
        values = {
            "ground": float(index),
            "ground.segment": float(number),
            "ground.probability": ground.probability,
        }
        try:
            members.append(ParameterSet(index, values, ground_study(study, ground)))
        except InputError as error:
            members.append(ParameterSet(index, values, study, failure=_reason(ground, error)))
    return members


def ground_study(study: Study, ground: Ground) -> Study:
    """``study`` on ``ground`` alone.

    Raises
    ------
    InputError
        A material without properties, or without a law where it would settle; or a study that the
        schema refuses (a train faster than the ground's waves).
    """
    table = study.grounds_table
    assert table is not None
    heights = slabs(table.fine_m, table.fine_depth_m, table.coarse_m, table.depth_m)
    names = slab_materials(ground, heights)
    depth = max(study.settlement_settings(name).integration_depth_m for name in study.variant_names)
    _check(table, names, heights, depth)
    layers = []
    for place, name in enumerate(names):
        values = table.materials[name].model_dump(exclude_none=True)
        layer: dict[str, Any] = {key: values[key] for key in (*MATERIAL, *LAW) if key in values}
        layer["name"] = f"g{place + 1:02d}"
        if place < len(heights):
            layer["height_m"] = heights[place]
        layers.append(layer)
    return study.with_ground(layers, f"ground '{ground.name}'")


def _check(
    table: GroundsTable, names: tuple[str, ...], heights: tuple[float, ...], depth: float
) -> None:
    top = 0.0
    for name, height in zip(names, (*heights, float("inf")), strict=True):
        material = table.materials.get(name)
        if material is None:
            raise InputError(f"\nmaterial '{name}' is not in [grounds.materials]")
        if top < depth and material.settlement_a is None:
            why = f" ({material.no_law})" if material.no_law else ""
            raise InputError(
                f"\nno settlement law for '{name}'{why}, {top:g} m below the subgrade surface: give "
                f"[grounds.materials] {name} its {', '.join(LAW)}"
            )
        top += height


def _reason(ground: Ground, error: InputError) -> str:
    lines = [line.strip() for line in str(error).splitlines()[1:] if line.strip()]
    return f"ground '{ground.name}': {'; '.join(lines)}"[:500]
