"""How many rows a study has: what the shards of a run are cut from."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mcsettle.study.study import Study


@dataclass(frozen=True)
class Extent:
    """``realisations`` of every variant and scenario in each of ``n_sets`` parameter sets.

    ``nested``: the sets are draws, or grounds, of the study; else there is one, the study itself.
    """

    n_sets: int
    variants: tuple[str, ...]
    scenarios: tuple[str, ...]
    realisations: int
    nested: bool

    @property
    def groups(self) -> int:
        """Parameter sets × variants × scenarios."""
        return self.n_sets * len(self.variants) * len(self.scenarios)

    @property
    def rows(self) -> int:
        """Rows of the table ``realisations``."""
        return self.groups * self.realisations


def extent_of(study: "Study") -> Extent:
    """The extent of ``study``, whose parameter sets need not be drawn for it."""
    return Extent(
        study.n_sets,
        study.variant_names,
        study.scenario_names,
        study.run.realisations,
        study.nested,
    )
