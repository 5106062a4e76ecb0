"""Ground layers given in full, and pads under the sleepers, from the tables of a study."""

import math
from collections.abc import Sequence

from mcsettle.railway.track import Layer, Material, PowerLaw, Sleeper
from mcsettle.study.schema.track import GroundTable, UnderSleeperPadTable

_NEEDED = ("youngs_modulus_pa", "poisson", "density_kg_per_m3", "damping")
_LAW = ("settlement_a", "settlement_b", "settlement_m", "strength_pa")
_EMBANKMENT = ("width_m", "ballast_coefficient_per_mpa2", "ballast_log_slope")


def with_ground(layers: tuple[Layer, ...], tables: Sequence[GroundTable]) -> tuple[Layer, ...]:
    """Layers with the ground below the embankment replaced by ``tables``, if there are any.

    Raises
    ------
    ValueError
        A layer lacks something, or has what ground layers do not have.
    """
    if not tables:
        return layers
    kept = tuple(layer for layer in layers if layer.width is not None)
    last = len(tables) - 1
    return kept + tuple(_ground_layer(table, i == last) for i, table in enumerate(tables))


def under_sleeper_pad(table: UnderSleeperPadTable, sleeper: Sleeper) -> Layer:
    """The pads under the sleepers, smeared along the track as the sleepers are.

    Pressed without bulging (ν = 0), a pad of bedding modulus C and thickness h has E = C h.
    """
    modulus = table.bedding_modulus_n_per_m3 * table.thickness_m * sleeper.fill
    material = Material(modulus, 0.0, table.density_kg_per_m3 * sleeper.fill, table.damping)
    return Layer("under_sleeper_pad", table.thickness_m, material, None, sleeper.length)


def _ground_layer(table: GroundTable, lowest: bool) -> Layer:
    """One ground layer in full; without settlement keys it does not settle."""
    missing = [key for key in _NEEDED if getattr(table, key) is None]
    if (table.height_m is None) != lowest:
        missing.append("no height_m (it is the half-space)" if lowest else "height_m")
    given = [key for key in _LAW if getattr(table, key) is not None]
    if given:
        missing += [key for key in _LAW if key not in given]
    if missing:
        raise ValueError(f"ground layer '{table.name}' needs {', '.join(missing)}")
    for key in _EMBANKMENT:
        if getattr(table, key) is not None:
            raise ValueError(f"ground layer '{table.name}' has no {key}: leave it out")
    material = Material(*(getattr(table, key) for key in _NEEDED))
    law = PowerLaw(*(getattr(table, key) for key in _LAW)) if given else None
    height = math.inf if table.height_m is None else table.height_m
    k0 = 0.5 if table.k0 is None else table.k0
    return Layer(table.name, height, material, law, None, k0)
