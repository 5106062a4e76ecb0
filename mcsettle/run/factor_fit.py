"""A settlement factor for every parameter set, drawn from what the observations leave of it.

An uncertain settlement factor is a scale that observed days or SDs know far better than any prior. With
one draw of it a set, hardly any set would come near them. So each set e draws its factor f not from the
prior but from its own posterior, with its other inputs as they are:

    p(f | e, observed) ∝ π(f) L(f, e),        weight of the set  Z(e) = ∫ π(f) L(f, e) df,

with L of ``factor_model``. That is importance sampling with the best proposal there is for one input: the
weights carry what the observations say of the other inputs, and the ensemble does not collapse on a few
sets.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcsettle.estimate.conditioning import FIT_TRACKS
from mcsettle.estimate.factor_posterior import OfFactors, Prior, factor_posterior
from mcsettle.run.compute import Job
from mcsettle.run.factor_model import FactorModel
from mcsettle.run.shards import Shard
from mcsettle.step_a.transfers import StepA, step_a
from mcsettle.storage import store
from mcsettle.storage.location import Place
from mcsettle.storage.provenance import Provenance
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.study.run_inputs import RunInputs

TABLE = "fits"


@dataclass(frozen=True)
class Fit:
    """Factor of one parameter set in one variant, and the logarithm of its weight (its evidence)."""

    factor: float
    log_evidence: float


def write_fits(
    at: Place, run: RunInputs, index: int, fits: Mapping[str, Fit], provenance: Provenance
) -> None:
    """Write the fits of one parameter set, by variant."""
    logs = [fit.log_evidence for fit in fits.values()]
    columns: dict[str, Any] = {
        "variant": list(fits),
        "parameter_set": np.full(len(fits), index, np.int32),
        "input": [run.fitted[variant].path for variant in fits],
        "value": [fit.factor for fit in fits.values()],
        "log_evidence": [log if np.isfinite(log) else None for log in logs],
    }
    store.write(at, TABLE, f"set{index:06d}.parquet", columns, provenance)


def read_fits(at: Place, run: RunInputs) -> dict[int, dict[str, Fit]]:
    """Fits by parameter set and variant that a folder holds."""
    if not run.fitted or not any(at.names(TABLE)):
        return {}
    fits: dict[int, dict[str, Fit]] = {}
    for row in store.read(at, TABLE).to_pylist():
        log = -np.inf if row["log_evidence"] is None else row["log_evidence"]
        fits.setdefault(row["parameter_set"], {})[row["variant"]] = Fit(row["value"], log)
    return fits


def with_fits(run: RunInputs, fits: Mapping[int, Mapping[str, Fit]]) -> RunInputs:
    """The run with the factors of its parameter sets as fitted, of those that have ``fits``."""
    factors = {
        index: {run.fitted[variant].path: fit.factor for variant, fit in of_set.items()}
        for index, of_set in fits.items()
    }
    sets = [m.with_values(factors[m.index]) if m.index in factors else m for m in run.sets]
    return replace(run, sets=sets)


COARSE, FEW_TRACKS = 13, 16  # factors over the whole prior, tracks of each (whatever the run has)
FINE = 9  # factors across the posterior


def fit_sets(job: Job, todo: Sequence[Shard]) -> RunInputs:
    """The run with its factors fitted: those in the folder, and those that ``todo`` needs beside them.

    What is fitted is written there at once.
    """
    run, fits = job.run, read_fits(job.at, job.run)
    for index in sorted({shard.member for shard in todo} - set(fits)):
        member = run.sets[index]
        job.progress("Fitting the factor of every set", index, len(run.sets))
        prepared = step_a(member.scenes, job.progress, job.options.processes, run.transfers)
        fits[index] = {
            variant: fit_factor(run, member, prepared, variant) for variant in run.fitted
        }
        write_fits(job.at, run, index, fits[index], job.provenance)
    return with_fits(run, fits)


def fit_factor(run: RunInputs, member: ParameterSet, prepared: StepA, variant: str) -> Fit:
    """Factor of one parameter set at its own share of the posterior, and the evidence.

    A set that no factor brings near the observations keeps its draw of the prior, with no weight.
    """
    scenes = [scene for scene in member.scenes if scene.variant == variant]
    model = FactorModel(scenes, prepared, run.observations)
    path, prior = run.fitted[variant]
    return draw_factor(model.likelihood, prior, member.shares[path], member.values[path])


def draw_factor(likelihood: OfFactors, prior: Prior, share: float, of_prior: float) -> Fit:
    """Factor at ``share`` of its posterior, and the evidence; ``of_prior`` where none fits."""
    passes = (COARSE, FEW_TRACKS), (FINE, FIT_TRACKS)
    posterior = factor_posterior(likelihood, prior, passes)
    if posterior is None:
        return Fit(of_prior, -np.inf)
    return Fit(posterior.factor_at(share), posterior.log_evidence)
