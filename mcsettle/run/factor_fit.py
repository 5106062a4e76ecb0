"""A settlement factor for every parameter set, drawn from what the observations leave of it.

An uncertain settlement factor is a scale that observed days or SDs know far better than any prior. With
one draw of it a set, hardly any set would come near them. So each set e draws its factor f not from the
prior but from its own posterior, with its other inputs as they are:

    p(f | e, observed) ∝ π(f) L(f, e),        weight of the set  Z(e) = ∫ π(f) L(f, e) df,

with L of ``observed``. That is importance sampling with the best proposal there is for one input: the
weights carry what the observations say of the other inputs, and the ensemble does not collapse on a few
sets. L comes from the engine on two grids of factors, between them linear in log(f) track by track.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcsettle.estimate.conditioning import FIT_TRACKS
from mcsettle.estimate.likelihood import likelihood_of
from mcsettle.estimate.observation import Observation
from mcsettle.step_a.transfers import StepA, TransferStore, step_a
from mcsettle.step_b.case import Case, Outcome, build_case
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.storage import store
from mcsettle.storage.location import Place
from mcsettle.storage.provenance import Provenance
from mcsettle.study.distributions import Distribution
from mcsettle.study.parameter_sets import ParameterSet, all_sets
from mcsettle.study.schema.uncertain import UncertainTable
from mcsettle.study.study import Study
from mcsettle.types import Progress
from mcsettle.units import MM

TABLE = "fits"


@dataclass(frozen=True)
class Fit:
    """Factor of one parameter set in one variant, and the logarithm of its weight (its evidence)."""

    factor: float
    log_evidence: float


def write_fits(
    at: Place, study: Study, index: int, fits: Mapping[str, Fit], provenance: Provenance
) -> None:
    """Write the fits of one parameter set, by variant."""
    logs = [fit.log_evidence for fit in fits.values()]
    columns: dict[str, Any] = {
        "variant": list(fits),
        "parameter_set": np.full(len(fits), index, np.int32),
        "input": [study.fitted[variant].input for variant in fits],
        "value": [fit.factor for fit in fits.values()],
        "log_evidence": [log if np.isfinite(log) else None for log in logs],
    }
    store.write(at, TABLE, f"set{index:06d}.parquet", columns, provenance)


def read_fits(at: Place, study: Study) -> dict[int, dict[str, Fit]]:
    """Fits by parameter set and variant that a folder holds."""
    if not study.fitted or not any(at.names(TABLE)):
        return {}
    found: dict[int, dict[str, Fit]] = {}
    for row in store.read(at, TABLE).to_pylist():
        log = -np.inf if row["log_evidence"] is None else row["log_evidence"]
        found.setdefault(row["parameter_set"], {})[row["variant"]] = Fit(row["value"], log)
    return found


def with_fits(study: Study, member: ParameterSet, fits: Mapping[str, Fit]) -> ParameterSet:
    """The parameter set with its factors as fitted."""
    if not fits:
        return member
    own = {study.fitted[variant].input: fit.factor for variant, fit in fits.items()}
    values = member.values | own
    return replace(member, values=values, study=study.with_inputs(values))


def fitted_sets(at: Place, study: Study) -> list[ParameterSet]:
    """Every parameter set of ``study``, with the factors that the folder has fits of."""
    fits = read_fits(at, study)
    return [with_fits(study, member, fits.get(member.index, {})) for member in all_sets(study)]


COARSE, FEW_TRACKS = 13, 16  # factors over the whole prior, tracks of each (whatever the run has)
FINE = 9  # factors across the posterior
CELLS = 400  # of the grid on which the posterior is integrated
NEGLIGIBLE = 1e-5  # share of the posterior left out at each end of the fine grid
FAR = 8.0  # errors beyond every observed SD a track is followed no further
LONGER = 3.0  # than the longest interval observed: so far a track is followed


def fit_sets(
    study: Study,
    members: Sequence[ParameterSet],
    needed: Collection[int],
    at: Place,
    provenance: Provenance,
    shared_transfers: TransferStore,
    progress: Progress | None = None,
    processes: int = 1,
) -> list[ParameterSet]:
    """Members with their factors fitted: those in the folder, and those ``needed`` that are not.

    What is fitted is written there at once.
    """
    held = read_fits(at, study)
    found = []
    for member in members:
        if member.index in needed and member.index not in held:
            if progress is not None:
                progress("Fitting the factor of every set", member.index, len(members))
            prepared = step_a(member.study.scenes, progress, processes, shared_transfers)
            fits = {
                variant: fit_factor(study, member, prepared, variant, entry)
                for variant, entry in study.fitted.items()
            }
            write_fits(at, study, member.index, fits, provenance)
            held[member.index] = fits
        found.append(with_fits(study, member, held.get(member.index, {})))
    return found


def fit_factor(
    study: Study, member: ParameterSet, prepared: StepA, variant: str, entry: UncertainTable
) -> Fit:
    """Factor of one parameter set at its own share of the posterior, and the evidence.

    A set that no factor brings near the observations keeps its draw of the prior, with no weight.
    """
    model = _Model(study, member.study, prepared, variant)
    path = entry.input
    return draw_factor(
        model.log_likelihood, entry.built(), member.shares[path], member.values[path]
    )


def draw_factor(
    likelihood: Callable[[np.ndarray, np.ndarray, int], np.ndarray],
    prior: Distribution,
    share: float,
    of_prior: float,
) -> Fit:
    """Factor at ``share`` of its posterior, and the evidence; ``of_prior`` where none fits.

    ``likelihood(logs, wanted, n_tracks)``: log likelihood [W] at the log factors ``wanted``, from
    the model at ``logs``.
    """
    low, high = (float(np.log(end)) for end in prior.ends)
    for n_factors, n_tracks in ((COARSE, FEW_TRACKS), (FINE, FIT_TRACKS)):
        logs = np.linspace(low, high, n_factors)
        cells = np.linspace(low, high, CELLS + 1)
        middle = 0.5 * (cells[1:] + cells[:-1])
        mass = np.diff(prior.share_below(np.exp(cells)))
        found = likelihood(logs, middle, n_tracks)
        highest = float(np.max(found))
        if not np.isfinite(highest):
            return Fit(of_prior, -np.inf)
        density = mass * np.exp(found - highest)
        total = float(np.sum(density))
        if not total > 0.0:
            return Fit(of_prior, -np.inf)
        reached = np.append(0.0, np.cumsum(density) / total)
        step = (high - low) / (n_factors - 1)
        ends = np.interp([NEGLIGIBLE, 1.0 - NEGLIGIBLE], reached, cells)
        low, high = max(low, ends[0] - step), min(high, ends[1] + step)
    at = float(np.interp(share, reached, cells))
    return Fit(float(np.exp(at)), highest + float(np.log(total)))


class _Model:
    """Likelihood of the observations for any factor, the other inputs those of one set."""

    def __init__(self, study: Study, own: Study, prepared: StepA, variant: str) -> None:
        self.study, self.own, self.variant = study, own, variant
        names = dict.fromkeys(entry.scenario for entry in study.observed)
        self.cases = {name: build_case(own.scene(variant, name), prepared) for name in names}

    def log_likelihood(self, logs: np.ndarray, wanted: np.ndarray, n_tracks: int) -> np.ndarray:
        """Log likelihood [W] at the log factors ``wanted``, from the engine at ``logs`` [F]."""
        profiles = self.own.initial_profiles(self.variant).sample(range(n_tracks))

        def predicted(observation: Observation) -> np.ndarray:
            values = _between(logs, self._values(observation, logs, profiles), wanted)
            return np.exp(values) if observation.is_interval else values

        return likelihood_of(self.study.observations, predicted).plain()

    def _values(
        self, observation: Observation, logs: np.ndarray, profiles: np.ndarray
    ) -> np.ndarray:
        """Log days or SDs [mm], [F, R]; NaN where the track failed."""
        case, n = self.cases[observation.scenario], len(profiles)
        if observation.day is None:
            horizon = min(case.horizon, LONGER * observation.value)
            outcome = _advanced(replace(case, horizon=horizon), logs, profiles, np.zeros(0))
            days = np.where(outcome.reached, outcome.days, horizon)
            values = np.where(outcome.failed, np.nan, np.log(np.maximum(days, 1e-9)))
            return values.reshape(-1, n)
        reach = (observation.value + FAR * observation.error) * MM
        limit, day = max(case.sd_limit, reach), observation.day
        own = replace(case, sd_limit=limit, horizon=max(1.001 * day, 1.0))
        outcome = _advanced(own, logs, profiles, np.array([day]))
        sd = np.where(np.isnan(outcome.history[:, 0]), limit, outcome.history[:, 0]) / MM
        return np.where(outcome.failed, np.nan, sd).reshape(-1, n)


def _advanced(case: Case, logs: np.ndarray, profiles: np.ndarray, days: np.ndarray) -> Outcome:
    """Every track at every factor, factors outermost."""
    model = replace(case.model, settlement_factor=1.0)
    machine = CycleJump(replace(case, model=model))
    factors = np.repeat(np.exp(logs), len(profiles))
    return machine.run(np.tile(profiles, (len(logs), 1)), days, factors)


def _between(logs: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Values [W, R] at ``wanted``, linear between those [F, R] at ``logs``."""
    return np.stack([np.interp(wanted, logs, column) for column in values.T], axis=1)
