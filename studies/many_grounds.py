"""What the settings for one ground of many cost in accuracy, and what they save.

    python studies/many_grounds.py studies/linespeed_ground.toml --sets 4

For evenly spaced parameter sets of the study: Step A by the settings that a study with many grounds has,
and by those of a study with one. Printed: CPU seconds of both, errors of the days to the limit and of
the effects, of 64 realisations in every scenario: their mean (a bias, common to all) and the largest.
"""

import argparse
import os
import tempfile
import time
from dataclasses import replace

import numpy as np

from mcsettle.run.left_out import intervals_of
from mcsettle.step_a.transfers import step_a
from mcsettle.study.parameter_sets import all_sets
from mcsettle.study.study import Study, load_study
from mcsettle.study.transfer_store import transfer_store

TRACKS = range(64)


def main() -> None:
    """One line a parameter set, then all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", nargs="?", default="studies/linespeed_ground.toml")
    parser.add_argument("--sets", type=int, default=4)
    arguments = parser.parse_args()
    sound = [m for m in all_sets(load_study(arguments.study)) if not m.failure]
    at = np.linspace(0, len(sound) - 1, min(arguments.sets, len(sound))).astype(int)
    print("set   CPU s          days: mean, largest    effects: mean, largest")
    errors = []
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MCSETTLE_CACHE"] = folder  # nothing is known before
        for member in (sound[i] for i in at):
            spent, days, points = _compared(member.study)
            errors.append((days, points))
            print(
                f"{member.index:<5d} {spent[0]:3.0f} of {spent[1]:3.0f}     {_mean_and_largest(days)} %"
                f"         {_mean_and_largest(points)} points",
                flush=True,
            )
    for errors_of, unit in zip(zip(*errors, strict=True), ("% of days", "points"), strict=True):
        found = np.abs(np.concatenate([each.ravel() for each in errors_of]))
        median, p95 = np.nanquantile(found, (0.5, 0.95))
        print(f"median {median:.2f}, 95 % below {p95:.2f} {unit}")


def _compared(study: Study) -> tuple[list[float], np.ndarray, np.ndarray]:
    """CPU seconds, and errors of days [%] and of effects [percentage points] by scenario and track."""
    many = replace(transfer_store(study), many_grounds=True)
    spent, days = [], []
    for store in (many, replace(many, many_grounds=False)):
        started = time.process_time()
        transfers = step_a(study.scenes, store=store.emptied()).transfers
        spent.append(time.process_time() - started)
        days.append(np.stack([intervals_of(scene, transfers, TRACKS) for scene in study.scenes]))
    few, usual = (100.0 * (1.0 - each[1:] / each[:1]) for each in days)
    return spent, 100.0 * (days[0] / days[1] - 1.0), few - usual


def _mean_and_largest(errors: np.ndarray) -> str:
    return f"{np.nanmean(errors):5.2f}, {np.nanmax(np.abs(errors)):.2f}"


if __name__ == "__main__":
    main()
