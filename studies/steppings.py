"""Days to the limit by every axle, every train and cycle jump: 1000 tracks at 201 km/h, linear ground.

Every axle is some 2.4e9 axle passages: 75 CPU minutes, of which both cores take half. The march is saved
every minute, so an interrupted run goes on where it stopped. Figures are printed as a table and drawn.
Usage: ``python studies/steppings.py [--out results/steppings] [--realisations 1000]``.
"""

import argparse
import json
import os
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np

from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Case, Outcome
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.engine import engine_for
from mcsettle.step_b.stepwise import March, MarchState
from mcsettle.study.study import load_study

STUDY = Path(__file__).with_name("linespeed.toml")
VARIANT, SCENARIO = "linear", "v201"
SAVE_EVERY = 60.0  # s
STEPPINGS = ("cycle_jump", "every_train", "every_axle")


def main() -> None:
    """Run what is missing, then compare and draw."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", type=Path, default=Path("results/steppings"))
    options.add_argument("--realisations", type=int, default=1000)
    given = options.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    found = {name: outcome_of(name, given.out, given.realisations) for name in STEPPINGS}
    report(found)
    picture(found, given.out / "steppings.png")


def outcome_of(stepping: str, out: Path, n: int) -> dict[str, np.ndarray]:
    """Days, passages, seconds of one stepping: from its file, or run."""
    path = out / f"{stepping}-{n}.npz"
    if not path.exists():
        study = load_study(STUDY)
        case = build_case(study.scene(VARIANT, SCENARIO), step_a(study.scenes))
        saved = Saved(out / f"{stepping}-{n}.part.npz")
        outcome = run(case, stepping, study.initial_profiles(VARIANT).sample(range(n)), saved)
        wall, cpu = saved.spent()
        np.savez(path, days=outcome.days, passages=outcome.passages, sd=outcome.sd_final,
                 reached=outcome.reached, wall=wall, cpu=cpu)  # fmt: skip
        saved.path.unlink(missing_ok=True)
    with np.load(path) as arrays:
        return dict(arrays)


class Saved:
    """The march on disk, and the time that has gone into it."""

    def __init__(self, path: Path) -> None:
        self.path, self.begun = path, None
        self.before, self.start, self.written = (0.0, 0.0), _clocks(), time.monotonic()
        if path.exists():
            with np.load(path) as arrays:
                held = dict(arrays)
            self.before = tuple(held.pop("spent"))
            self.begun = MarchState(**held | {"done": int(held["done"])})

    def spent(self) -> tuple[float, float]:
        """Wall and CPU seconds so far, of all parts."""
        parts = zip(self.before, self.start, _clocks(), strict=True)
        wall, cpu = (before + now - start for before, start, now in parts)
        return wall, cpu

    def keep(self, march: March) -> None:
        """Write the march now and then, whole or not at all."""
        if time.monotonic() < self.written + SAVE_EVERY:
            return
        state, half = march.state(), self.path.with_suffix(".half")
        with half.open("wb") as file:
            np.savez(file, **asdict(state), spent=np.array(self.spent()))
        os.replace(half, self.path)
        self.written = time.monotonic()
        wall, cpu = self.spent()
        note = {"updates": state.done, "active": int(state.active.sum())}
        print(json.dumps(note | {"wall_s": round(wall), "cpu_s": round(cpu)}), flush=True)


def run(case: Case, stepping: str, tracks: np.ndarray, saved: Saved) -> Outcome:
    """One stepping of ``tracks`` to the limit."""
    engine = engine_for(case, stepping)
    if isinstance(engine, CycleJump):
        return engine.run(tracks, np.zeros(0))
    march = engine.march(tracks, np.zeros(0), saved.begun)
    for _ in march:
        saved.keep(march)
    return march.outcome()


def report(found: dict[str, dict[str, np.ndarray]]) -> None:
    """Print seconds, and the differences in days to every axle."""
    truth = found["every_axle"]["days"]
    head = ("stepping", "axle passages", "wall s", "CPU s", "largest", "mean", "5 %", "95 %")
    print("| " + " | ".join(head) + " |\n" + "|--" * len(head) + "|")
    for name, arrays in found.items():
        off = arrays["days"] / truth - 1.0
        low, high = np.quantile(off, [0.05, 0.95])
        figures = (np.abs(off).max(), off.mean(), low, high)
        cells = [f"{arrays['passages'].sum():.4g}", f"{arrays['wall']:.3g}", f"{arrays['cpu']:.3g}"]
        print(f"| {name} | " + " | ".join(cells + [f"{v:.1e}" for v in figures]) + " |")


def picture(found: dict[str, dict[str, np.ndarray]], path: Path) -> None:
    """Draw the distributions of the differences and the differences against the days."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    truth = found["every_axle"]["days"]
    figure, axes = plt.subplots(2, 2, figsize=(9.0, 5.4), layout="constrained")
    for column, (name, title) in enumerate(
        [("cycle_jump", "cycle jump (default)"), ("every_train", "every train")]
    ):
        late = (found[name]["days"] / truth - 1.0) * 1e6
        axes[0, column].hist(late, bins=40, color="#35618f")
        axes[0, column].set(title=title, xlabel="difference in days from every axle [millionths]")
        axes[1, column].plot(
            truth, (found[name]["days"] - truth) * 3168, ".", ms=3, color="#35618f"
        )
        axes[1, column].set(xlabel="days to the limit, every axle")
    axes[0, 0].set_ylabel("tracks")
    axes[1, 0].set_ylabel("difference [axle passages]")
    figure.savefig(path, dpi=150)
    plt.close(figure)


def _clocks() -> tuple[float, float]:
    return time.monotonic(), time.process_time()


if __name__ == "__main__":
    main()
