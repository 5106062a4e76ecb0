"""Fitted settlement factors on disk: one small shard a parameter set, written once and kept.

A fit depends on the study and the set alone, so slices of a run and later, larger runs share them.

Depends on: draws, place, store, study.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mcsettle import store
from mcsettle.draws import ParameterSet, all_sets
from mcsettle.place import Place
from mcsettle.study import Study

TABLE = "fits"


@dataclass(frozen=True)
class Fit:
    """Factor of one parameter set in one variant, and the logarithm of its weight (its evidence)."""

    factor: float
    log_evidence: float


def write_fits(
    at: Place, study: Study, index: int, fits: Mapping[str, Fit], provenance: store.Provenance
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
