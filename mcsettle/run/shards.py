"""The shards of a run: parameter set × variant × scenario × range of realisations, in a fixed order.

Shard boundaries depend on the shard size alone, so a run that grows keeps its shards, and a slice
``i/n`` of a run is the same everywhere. Shards of one parameter set, variant and scenario share their
preparation; a slice is a block of neighbours.
"""

import re
from dataclasses import dataclass
from typing import NamedTuple

from mcsettle.errors import InputError
from mcsettle.railway.scene import Scene
from mcsettle.storage.shard_name import ShardName, slug
from mcsettle.study.extent import Extent

MOST_SHARDS = 5_000_000
# Measured in docs/scale.md: of a shard whatever its rows, of a realisation, of an SD of its history.
SHARD_BYTES, REALISATION_BYTES, SD_BYTES = 12_000.0, 26.0, 6.6
_SLICE = re.compile(r"\s*([0-9]{1,9})\s*/\s*([0-9]{1,9})\s*")


@dataclass(frozen=True)
class Shard:
    """Realisations ``first`` to ``last`` of one parameter set, variant and scenario.

    ``nested``: the study has uncertain inputs, so the set is part of the name.
    """

    member: int
    variant: str
    scenario: str
    first: int
    last: int
    nested: bool = False

    @property
    def indices(self) -> range:
        """Its realisation indices."""
        return range(self.first, self.last + 1)

    @property
    def parts(self) -> ShardName:
        """What its file name consists of."""
        of_set = self.member if self.nested else None
        return ShardName(slug(self.variant), slug(self.scenario), self.first, self.last, of_set)

    @property
    def name(self) -> str:
        """Its file name in every table."""
        return str(self.parts)

    @property
    def group(self) -> tuple[int, str, str]:
        """What it shares with its neighbours."""
        return self.member, self.variant, self.scenario

    def is_of(self, scene: Scene) -> bool:
        """Whether it is of the variant and scenario of ``scene``."""
        return (self.variant, self.scenario) == (scene.variant, scene.scenario)


class Slice(NamedTuple):
    """Part ``i`` of ``n`` of a run, counted from 1."""

    i: int
    n: int

    def __str__(self) -> str:
        return f"{self.i}/{self.n}"


def parse_slice(text: str) -> Slice:
    """Slice of a text such as "17/64".

    Raises
    ------
    InputError
        It is not of this form, or counts from 0.

    Examples
    --------
    >>> parse_slice("17/64")
    Slice(i=17, n=64)
    """
    match = _SLICE.fullmatch(text)
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise InputError(
            f'shards= received "{text}"; it takes I/N with I from 1 to N, such as 17/64'
        )
    return Slice(int(match[1]), int(match[2]))


def index_ranges(n: int, size: int) -> list[range]:
    """Ranges of realisations of the shards of ``n`` realisations.

    Examples
    --------
    >>> index_ranges(5, 2)
    [range(0, 2), range(2, 4), range(4, 5)]
    """
    return [range(first, min(n, first + size)) for first in range(0, n, size)]


def n_shards(extent: Extent, size: int) -> int:
    """Shards of a run of ``extent``."""
    return extent.groups * -(-extent.realisations // size)


def all_shards(extent: Extent, size: int) -> list[Shard]:
    """Every shard of a run, of ``size`` realisations each, neighbours together.

    Raises
    ------
    InputError
        There are more than any folder can hold.
    """
    if n_shards(extent, size) > MOST_SHARDS:
        raise InputError(
            f"the run has {n_shards(extent, size)} shards of {size} realisations; at most "
            f"{MOST_SHARDS} are kept in one folder: give a larger shard_size= or split the study"
        )
    return [
        Shard(member, variant, scenario, part.start, part.stop - 1, extent.nested)
        for member in range(extent.n_sets)
        for variant in extent.variants
        for scenario in extent.scenarios
        for part in index_ranges(extent.realisations, size)
    ]


def slice_of(shards: list[Shard], part: Slice | None) -> list[Shard]:
    """The shards of a slice: blocks whose sizes differ by at most one; all of them without one."""
    if part is None:
        return shards
    first, stop = ((k * len(shards)) // part.n for k in (part.i - 1, part.i))
    return shards[first:stop]


def estimated_bytes(realisations: int, history_days: float, shards: int = 1) -> float:
    """Bytes on disk of ``realisations`` rows with ``history_days`` SDs each, in ``shards`` shards.

    Of ``realisations`` and ``history`` together, records included, ``effects`` not.

    Examples
    --------
    >>> round(estimated_bytes(2048, 33) / 1e6, 2)
    0.51
    """
    return shards * SHARD_BYTES + realisations * (REALISATION_BYTES + history_days * SD_BYTES)
