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
from mcsettle.storage.shard_name import shard_name
from mcsettle.study.extent import Extent

MOST_SHARDS = 5_000_000
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
    def name(self) -> str:
        """Its file name in every table."""
        of_set = self.member if self.nested else None
        return shard_name(self.variant, self.scenario, self.first, self.last, of_set)

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


def all_shards(extent: Extent, size: int) -> list[Shard]:
    """Every shard of a run, of ``size`` realisations each, neighbours together.

    Raises
    ------
    InputError
        There are more than any folder can hold.
    """
    n = extent.realisations
    n_shards = extent.groups * -(-n // size)
    if n_shards > MOST_SHARDS:
        raise InputError(
            f"the run has {n_shards} shards of {size} realisations; at most "
            f"{MOST_SHARDS} are kept in one folder: give a larger shard_size= or split the study"
        )
    return [
        Shard(member, variant, scenario, first, min(n, first + size) - 1, extent.nested)
        for member in range(extent.n_sets)
        for variant in extent.variants
        for scenario in extent.scenarios
        for first in range(0, n, size)
    ]


def slice_of(shards: list[Shard], part: Slice | None) -> list[Shard]:
    """The shards of a slice: blocks whose sizes differ by at most one; all of them without one."""
    if part is None:
        return shards
    first, stop = ((k * len(shards)) // part.n for k in (part.i - 1, part.i))
    return shards[first:stop]
