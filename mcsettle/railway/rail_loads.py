"""What of a wheelset's load, and of the rail's own bending, presses on the track."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RailLoads:
    """``bending_share``: how much of the load that a bent rail moves from hollows to humps counts, 0
    (none, and the rail follows every settlement) to 1; ``whole``: the whole load of a wheelset on each
    rail (receptance and stresses doubled), not half of it.
    """

    bending_share: float = 0.0
    whole: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.bending_share <= 1.0:
            raise ValueError(f"bending_share is {self.bending_share}; it must lie between 0 and 1")

    @property
    def description(self) -> dict[str, float | bool]:
        """What differs from half the load on each rail and no bending; empty if nothing does."""
        plain = RailLoads()
        return {name: value for name, value in vars(self).items() if value != getattr(plain, name)}


HALF = RailLoads()  # half a wheelset's load on each rail, no bending
