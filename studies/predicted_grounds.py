"""How well predicted grounds do, and what they save: 1000 softened grounds × 64 tracks × 4 speeds.

    OPENBLAS_NUM_THREADS=1 python studies/predicted_grounds.py --held-out 20

The study is linespeed_ground.toml on soil that softens, with ``[step_a] surrogate = true``. Without
MCSETTLE_CACHE it has an empty cache folder beside the results, so that nothing is known before. Printed:
grounds computed, wall time and CPU seconds of the complete run (its processes included); then, for sets
that were predicted and not learnt from, evenly spaced, errors of days and of effects against the same
sets computed in full, each speed on the ground that it softens itself. With ``--learn-only`` no tracks
are run but those of the held-out sets.
"""

import argparse
import os
import resource
import time
import tomllib
from pathlib import Path

import numpy as np

from mcsettle.kernels import runtime
from mcsettle.railway.scene import Scene
from mcsettle.run.left_out import intervals_of
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.surrogate import GroundPredictor
from mcsettle.run.train_surrogate import set_predictor
from mcsettle.step_a.processes import process_pool
from mcsettle.step_a.transfers import Predictor, TransferStore, into_cache, step_a
from mcsettle.study.candidates import candidates_of
from mcsettle.study.parameter_sets import ParameterSet, all_sets
from mcsettle.study.study import Study
from mcsettle.study.transfer_store import transfer_store

STUDY = Path(__file__).resolve().parent / "linespeed_ground.toml"
TRACKS = range(64)


def main() -> None:
    """Run, then compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/predicted_grounds"))
    parser.add_argument("--sets", type=int, default=1000)
    parser.add_argument("--most-grounds", type=int, default=80)
    parser.add_argument("--tolerance-points", type=float, default=3.0)
    parser.add_argument("--held-out", type=int, default=20)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--learn-only", action="store_true")
    arguments = parser.parse_args()
    os.environ.setdefault("MCSETTLE_CACHE", str(arguments.out / "cache"))
    study = _study(arguments.sets, arguments.most_grounds, arguments.tolerance_points)
    started = time.monotonic()
    runtime.running(1 if arguments.processes > 1 else None)  # as the run has it
    store = transfer_store(study)
    training = set_predictor(candidates_of(study), store, arguments.processes, _said)
    assert training is not None
    print(f"{training.text}; {_times(started)}", flush=True)
    if not arguments.learn_only:
        options = RunOptions(processes=arguments.processes)
        finished = run_study(study, arguments.out / "run", options, _said)
        print("\n".join(finished.remarks))
        print(f"{arguments.sets} sets: {_times(started)}", flush=True)
    _compare(study, store, arguments.held_out, arguments.processes)


def _study(n_sets: int, most_grounds: int, tolerance_points: float) -> Study:
    data = tomllib.loads(STUDY.read_text(encoding="utf-8"))
    data["track"]["soil"] = "equivalent_linear"
    data["run"] |= {"parameter_sets": n_sets, "realisations": len(TRACKS)}
    data["step_a"] = {
        "surrogate": True,
        "most_grounds": most_grounds,
        "tolerance_points": tolerance_points,
    }
    return Study.from_mapping(data)


def _said(stage: str, done: int, total: int) -> None:
    print(f"{stage}: {done} of {total}", flush=True)


def _times(started: float) -> str:
    cpu = sum(
        usage.ru_utime + usage.ru_stime
        for usage in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )
    return f"{time.monotonic() - started:.0f} s wall, {cpu:.0f} CPU s"


def _compare(study: Study, store: TransferStore, n: int, processes: int) -> None:
    """Errors of sets that were not learnt from, computed in full."""
    predictor, full = store.predictor, store.emptied()
    assert isinstance(predictor, GroundPredictor)
    learnt = set(predictor.training.sets)
    members = [m for m in all_sets(study) if not m.failure and m.index not in learnt]
    predicted = [m for m in members if predictor.answers(m.study.scenes)]
    print(f"{len(predicted)} of the {len(members)} sets not learnt from are predicted")
    at = np.linspace(0, len(predicted) - 1, min(n, len(predicted))).astype(int)
    held_out, started = [predicted[i] for i in at], time.monotonic()
    with process_pool(processes) as pool:
        for running in [pool.submit(into_cache, m.study.scenes, full) for m in held_out]:
            running.result()
    print(
        f"{len(held_out)} sets computed in full: {_times(started)} since the beginning", flush=True
    )
    errors = [_errors(member, predictor, full) for member in held_out]
    for member, (days, points) in zip(held_out, errors, strict=True):
        print(
            f"set {member.index}: expected {predictor.error_percent(member.study.scenes):.2f} %, "
            f"median track: days off by {np.round(np.nanmedian(days, axis=1), 2)} %, "
            f"effects by {np.round(np.nanmedian(points, axis=1), 2)} points",
            flush=True,
        )
    for unit, of_sets in zip(
        ("% in days", "points in effects"), zip(*errors, strict=True), strict=True
    ):
        stacked = np.stack(of_sets)
        for what, signed in (("tracks", stacked), ("median tracks", np.nanmedian(stacked, axis=2))):
            median, p95 = np.nanquantile(np.abs(signed), (0.5, 0.95))
            print(f"held out, {what}: {median:.2f} {unit} (median), 95 % below {p95:.2f}")


def _errors(
    member: ParameterSet, predictor: Predictor, full: TransferStore
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the days [%] by scenario and track of a set, and of the effects [points]."""
    scenes = member.study.scenes
    exact, predicted = step_a(scenes, store=full), predictor.predict(scenes)
    both = np.stack([_days(scenes, each.transfers) for each in (exact, predicted)])
    reductions = 100.0 * (1.0 - both[:, 1:] / both[:, :1])
    return 100.0 * (both[1] / both[0] - 1.0), reductions[1] - reductions[0]


def _days(scenes: tuple[Scene, ...], transfers: dict) -> np.ndarray:  # type: ignore[type-arg]
    """Days [scenario, track] to the limit."""
    return np.stack([intervals_of(scene, transfers, TRACKS) for scene in scenes])


if __name__ == "__main__":
    main()
