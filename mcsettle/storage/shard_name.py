"""Names of shards: made of their parts, and taken apart again, in one place.

    VARIANT--SCENARIO--FIRST-LAST.parquet
    VARIANT--SCENARIO--setNNNNNN--FIRST-LAST.parquet      of a study with uncertain inputs

No part holds two hyphens in a row, so a name is read as it was made, whatever scenarios are called.
"""

import hashlib
import re
from dataclasses import dataclass

_PART = r"[A-Za-z0-9._]+(?:-[A-Za-z0-9._]+)*"
_NAME = re.compile(
    rf"({_PART})--({_PART})--(?:set([0-9]{{6,}})--)?([0-9]{{8,}})-([0-9]{{8,}})\.parquet"
)
_DIGEST = re.compile(r"(?:^|-)[0-9a-f]{8}$")


@dataclass(frozen=True)
class ShardName:
    """Slugs of variant and scenario, first and last realisation, and where there are, the set."""

    variant: str
    scenario: str
    first: int
    last: int
    parameter_set: int | None = None

    @classmethod
    def read(cls, text: str) -> "ShardName | None":
        """The parts of a file's name; None where it is not that of a shard.

        Examples
        --------
        >>> ShardName.read("base--set2--00000000-00000063.parquet")
        ShardName(variant='base', scenario='set2', first=0, last=63, parameter_set=None)
        """
        parts = _NAME.fullmatch(text)
        if parts is None:
            return None
        of_set = None if parts[3] is None else int(parts[3])
        return cls(parts[1], parts[2], int(parts[4]), int(parts[5]), of_set)

    def __str__(self) -> str:
        of_set = "" if self.parameter_set is None else f"set{self.parameter_set:06d}--"
        return f"{self.variant}--{self.scenario}--{of_set}{self.first:08d}-{self.last:08d}.parquet"


def shard_name(
    variant: str, scenario: str, first: int, last: int, parameter_set: int | None = None
) -> str:
    """File name of the shard of realisations ``first`` to ``last``, both included.

    ``parameter_set`` is None in a study without uncertain inputs.

    Examples
    --------
    >>> shard_name("base", "A", 0, 255)
    'base--A--00000000-00000255.parquet'
    >>> shard_name("base", "A", 0, 63, 3)
    'base--A--set000003--00000000-00000063.parquet'
    """
    return str(ShardName(slug(variant), slug(scenario), first, last, parameter_set))


def slug(name: str) -> str:
    """The name if it is safe in a file name, else a safe form of it with a digest.

    A name that ends as if it had a digest is given one, so that it is not taken for another's.

    Examples
    --------
    >>> slug("A2"), slug("97 km/h"), slug("97-km-h-c3eaf3a0")
    ('A2', '97-km-h-c3eaf3a0', '97-km-h-c3eaf3a0-ad97c0d7')
    """
    safe = re.sub(r"[^A-Za-z0-9._]+", "-", name).strip("-.")[:60].strip("-")
    if safe == name and not _DIGEST.search(name):
        return name
    return f"{safe}-{hashlib.sha256(name.encode()).hexdigest()[:8]}".lstrip("-")
