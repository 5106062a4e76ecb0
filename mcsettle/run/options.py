"""How a study is run, as far as the study itself does not say."""

from dataclasses import dataclass

from mcsettle.errors import InputError
from mcsettle.run.shards import Slice
from mcsettle.study.study import Study

_MOST = {"threads": 4096, "batch": 2**53, "processes": 4096, "shard_size": 2**31}


@dataclass(frozen=True)
class RunOptions:
    """Choices of one run. None: as the study, or the results folder, has it.

    ``realisations``, ``parameter_sets``, ``seed`` replace the study's own; ``exact`` updates after
    every axle passage. These decide the results, the rest does not: ``threads`` of Taichi (None: all
    cores); ``batch``, realisations advanced at a time; ``processes`` for Step A and for large samples
    (more than 1 are spawned and need a main guard in the calling program); ``shards``, the slice to
    compute alone, leaving the run open for ``close.gather``; ``shard_size``, realisations of a shard
    (else 2048); ``take_over`` locks that processes of other hosts have left.
    """

    realisations: int | None = None
    parameter_sets: int | None = None
    seed: int | None = None
    exact: bool = False
    threads: int | None = None
    batch: int | None = None
    processes: int = 1
    shards: Slice | None = None
    shard_size: int | None = None
    take_over: bool = False

    def __post_init__(self) -> None:
        for name, most in _MOST.items():
            value = getattr(self, name)
            if value is not None and not 1 <= value <= most:
                raise InputError(f"{name} is {value}; it takes 1 to {most}")

    def applied_to(self, study: Study) -> Study:
        """The study with the sample size, seed and stepping of this run.

        Raises
        ------
        InputError
            A value that the study file would refuse.
        """
        stepping = "every_axle" if self.exact else None
        return study.with_run(self.realisations, self.seed, stepping, self.parameter_sets)
