"""A settlement factor for every parameter set, drawn from what the observations leave of it.

An uncertain settlement factor is a scale that observed days or SDs know far better than any prior. With
one draw of it a set, hardly any set would come near them. So each set e draws its factor f not from the
prior but from its own posterior, with its other inputs as they are:

    p(f | e, observed) ∝ π(f) L(f, e),        weight of the set  Z(e) = ∫ π(f) L(f, e) df,

with L of ``factor_model``. That is importance sampling with the best proposal there is for one input: the
weights carry what the observations say of the other inputs, and the ensemble does not collapse on a few
sets.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcsettle.estimate.conditioning import FIT_TRACKS
from mcsettle.estimate.factor_posterior import OfFactors, Prior, factor_posterior
from mcsettle.run.factor_model import FactorModel
from mcsettle.step_a.transfers import StepA, TransferStore, step_a
from mcsettle.storage import store
from mcsettle.storage.location import Place
from mcsettle.storage.provenance import Provenance
from mcsettle.study.parameter_sets import ParameterSet, all_sets
from mcsettle.study.schema.uncertain import UncertainTable
from mcsettle.study.study import Study
from mcsettle.types import Progress

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
    scenes = [member.study.scene(variant, name) for name in study.scenario_names]
    model = FactorModel(scenes, prepared, study.observations)
    path = entry.input
    return draw_factor(model.likelihood, entry.built(), member.shares[path], member.values[path])


def draw_factor(likelihood: OfFactors, prior: Prior, share: float, of_prior: float) -> Fit:
    """Factor at ``share`` of its posterior, and the evidence; ``of_prior`` where none fits."""
    passes = (COARSE, FEW_TRACKS), (FINE, FIT_TRACKS)
    posterior = factor_posterior(likelihood, prior, passes)
    if posterior is None:
        return Fit(of_prior, -np.inf)
    return Fit(posterior.factor_at(share), posterior.log_evidence)
