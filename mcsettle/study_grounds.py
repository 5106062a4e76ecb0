"""The grounds of a study, each as a study of its own: parameter sets that are counted, not drawn.

Depends on: draws, errors, grounds, inputs, study, study_schema.
"""

from typing import Any

from mcsettle.draws import ParameterSet
from mcsettle.errors import InputError
from mcsettle.grounds import Ground, slab_materials, slabs
from mcsettle.study import Study
from mcsettle.study_schema import GroundsTable

LAW = ("settlement_a", "settlement_b", "settlement_m", "strength_pa")
MATERIAL = ("youngs_modulus_pa", "poisson", "density_kg_per_m3", "damping", "k0")


def ground_sets(study: Study) -> list[ParameterSet]:
    """One parameter set for each ground of ``study``, as many as it asks for.

    A ground that cannot be run has its reason in ``failure`` and the study's own track.
    """
    segments: dict[str, int] = {}
    found = []
    for index, ground in enumerate(study.grounds()[: study.n_sets]):
        number = segments.setdefault(ground.segment, len(segments) + 1)
        values = {
            "ground": float(index),
            "ground.segment": float(number),
            "ground.probability": ground.probability,
        }
        try:
            found.append(ParameterSet(index, values, ground_study(study, ground)))
        except InputError as error:
            found.append(ParameterSet(index, values, study, failure=_reason(ground, error)))
    return found


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
