"""Step A of the parameter sets to come, computed ahead in processes of their own, one set a process.

Where the ground, a vehicle or a speed is uncertain, every set has a Step A of its own. Within one, the
bands of the ground share out to processes but the transfer functions do not; across sets everything
does. What a process finds it leaves in the cache folder, where the run picks it up, so a run that is
interrupted has lost the sets in flight and no more.
"""

from collections.abc import Mapping
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor
from contextlib import ExitStack, suppress

from mcsettle.errors import InputError, NumericalError
from mcsettle.railway.scene import Scene
from mcsettle.railway.track import SectionTrack
from mcsettle.step_a.processes import process_pool
from mcsettle.step_a.transfers import TransferStore, into_cache, needs
from mcsettle.types import Progress, silent

WORTHWHILE: type = SectionTrack  # a beam's Step A takes less than a process takes to start


class Prefetch(ExitStack):
    """A window of Step A's in flight; ``wait`` before a set is needed.

    Parameters
    ----------
    scenes : those of the parameter sets still to run, in their order, by index
    shared_transfers : what is at hand already; sets that need nothing else cost nothing here
    processes : at most so many; with one, or fewer than two sets to compute, nothing is started
    progress : called as progress(stage, done, total)
    """

    def __init__(
        self,
        scenes: Mapping[int, tuple[Scene, ...]],
        shared_transfers: TransferStore,
        processes: int,
        progress: Progress = silent,
    ) -> None:
        super().__init__()
        self.shared_transfers, self.processes, self.progress = shared_transfers, processes, progress
        self.left: list[tuple[int, tuple[Scene, ...]]] = []
        seen = set(shared_transfers.transfers)
        for index, of_set in scenes.items():
            keys = needs(of_set, shared_transfers)
            if not keys <= seen and any(isinstance(key[0], WORTHWHILE) for key in keys):
                self.left.append((index, of_set))
                seen |= keys
        self.total, self.done = len(self.left), 0
        self.running: dict[int, Future[None]] = {}
        self.pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> "Prefetch":
        if self.processes > 1 and self.total > 1:
            self.pool = self.enter_context(process_pool(min(self.processes, self.total)))
            self._fill()
        return self

    def wait(self, index: int) -> None:
        """Until what set ``index`` needs is in the cache folder.

        A set that failed there is left to the caller, who meets the same error.
        """
        awaited = self.running.pop(index, None)
        for passed in [k for k in self.running if k < index]:  # their rows were there after all
            self.running.pop(passed).cancel()
        self.left = [(k, of_set) for k, of_set in self.left if k > index]
        if self.pool is not None:
            self._fill()
        if awaited is None:
            return
        with suppress(InputError, NumericalError, CancelledError):
            awaited.result()
        self.done += 1
        self.progress("Step A: parameter sets", self.done, self.total)

    def _fill(self) -> None:
        assert self.pool is not None
        while self.left and len(self.running) <= self.processes:
            index, of_set = self.left.pop(0)
            store = self.shared_transfers.emptied()
            self.running[index] = self.pool.submit(into_cache, of_set, store)
