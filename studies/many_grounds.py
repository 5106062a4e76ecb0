"""What the settings for one ground of many cost in accuracy, and what they save.

    python studies/many_grounds.py studies/linespeed_ground.toml --sets 8

For evenly spaced parameter sets of the study: transfer functions of its first scenario by the settings
that a study with many grounds has, and by the usual ones with bases grown to a tolerance of 1e-3 (the
reference).
Printed: direct solutions, CPU seconds of the bases, relative errors of the stresses (quasi-static and
dynamic, in the Euclidean norm over axles, wavenumbers and depths) and of the rate at which SD grows,
the last as the worst of 64 tracks and as that of their mean.
"""

import argparse
import time
from dataclasses import replace

import numpy as np

from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.track import SectionTrack
from mcsettle.step_a.fem25d import Settings, section_response
from mcsettle.step_a.interaction import precompute
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_a.transfers import section_settings
from mcsettle.step_b.passage import mode_numbers
from mcsettle.step_b.settlement import cycle_rate
from mcsettle.step_b.spectral import growth, mode_pairs, train_form
from mcsettle.study.build import build_settlement
from mcsettle.study.parameter_sets import all_sets
from mcsettle.study.study import Study, load_study

TRACKS = range(64)
REFERENCE = 1e-3  # tolerance of the bases


def main() -> None:
    """One line a parameter set, then the worst."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", nargs="?", default="studies/linespeed_ground.toml")
    parser.add_argument("--sets", type=int, default=8)
    arguments = parser.parse_args()
    sound = [m for m in all_sets(load_study(arguments.study)) if not m.failure]
    at = np.linspace(0, len(sound) - 1, min(arguments.sets, len(sound))).astype(int)
    print("set   solutions    CPU s of bases   quasi-static  dynamic   rate, worst  mean")
    rows = []
    for member in (sound[i] for i in at):
        found = _compared(member.study)
        rows.append(found[4:])
        print(
            f"{member.index:<5d} {found[0]:3d} of {found[1]:3d}  {found[2]:5.1f} of {found[3]:5.1f}"
            "    " + "   ".join(f"{error:.1e}" for error in found[4:]),
            flush=True,
        )
    worst = np.max(rows, axis=0)
    print("worst" + " " * 35 + "   ".join(f"{error:.1e}" for error in worst))


def _compared(study: Study) -> tuple[int, int, float, float, float, float, float, float]:
    variant, scenario = study.variant_names[0], study.scenario_names[0]
    track = study.track(variant)
    assert isinstance(track, SectionTrack)
    depth = study.settlement_settings(variant).integration_depth_m
    service = study.timetable(scenario).services[0]
    own = section_settings(study.scenes, many_grounds=True)
    assert own is not None
    fine = Settings(tolerance=REFERENCE, max_solves=90)
    narrow = replace(fine, max_speed=own.max_speed, max_omega=own.max_omega)
    transfers, solves, spent = [], [], []
    for settings in (own, narrow):
        start = time.process_time()
        response = section_response(track, depth, settings, use_cache=False)
        spent.append(time.process_time() - start)
        solves.append(response.solves)
        modes = study.wavenumbers
        transfers.append(precompute(service.train, service.speed, response, modes))
    model = build_settlement(study.settlement_settings(variant), track)
    rates = [_rates(study, transfer, model) for transfer in transfers]
    first, second = transfers
    return (
        solves[0],
        solves[1],
        spent[0],
        spent[1],
        _difference(first.quasi_static, second.quasi_static),
        _difference(first.dynamic, second.dynamic),
        float(np.max(np.abs(rates[0] / rates[1] - 1.0))),
        float(np.abs(rates[0].mean() / rates[1].mean() - 1.0)),
    )


def _difference(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def _rates(study: Study, transfer: TransferFunctions, model: SettlementModel) -> np.ndarray:
    """Growth of each track's variance [R] under the first train, relative to the variance."""
    profiles = study.initial_profiles().sample(TRACKS)
    pairs = mode_pairs(mode_numbers(transfer.wavenumbers, study.profile.window_m))
    form = train_form(transfer, model, pairs)
    cycles = [cycle_rate(law, model.cycles_before(law)) for law in model.group_laws]
    weights = np.tile(np.array(cycles, dtype=float), (len(profiles), 1))
    change, _ = growth(form, profiles, weights, pairs)
    return np.asarray(
        np.sum((profiles.conj() * change).real, axis=1) / np.sum(np.abs(profiles) ** 2, axis=1)
    )


if __name__ == "__main__":
    main()
