"""Draws of a study's uncertain inputs: parameter set e is row e of one scrambled Sobol sequence.

A row is an address, not a draw: it depends on the study's seed, its uncertain inputs and e alone, so
more sets leave the earlier ones as they are, and scenarios and variants share them.

Depends on: errors, study, study_uncertain.
"""

from dataclasses import dataclass, field

import numpy as np

from mcsettle.errors import InputError
from mcsettle.study import Study
from mcsettle.study_uncertain import normal_scores_correlation

STREAM = 0x50BA1  # keeps these draws apart from those of the profiles
LARGEST_SEQUENCE = 2**20


@dataclass(frozen=True)
class ParameterSet:
    """One draw: ``values`` by key path (in the unit of the key), and the study that has them.

    ``shares`` are the cumulative probabilities drawn, by input.
    ``failure``: why it cannot be run, if it cannot.
    """

    index: int
    values: dict[str, float]
    study: Study
    shares: dict[str, float] = field(default_factory=dict)
    failure: str = ""


def unit_draws(study: Study, n_sets: int | None = None) -> np.ndarray:
    """Cumulative probabilities [E, D] of the draws, correlated as the study asks for."""
    from scipy import special, stats

    n, n_inputs = study.n_sets if n_sets is None else n_sets, len(study.uncertain)
    if n > LARGEST_SEQUENCE:
        raise InputError(f"{n} parameter sets; at most {LARGEST_SEQUENCE}")
    rng = np.random.default_rng([STREAM, study.seed])
    sobol = stats.qmc.Sobol(n_inputs, scramble=True, rng=rng)
    shares = sobol.random_base2(max(0, int(n - 1).bit_length()))[:n]
    shares = np.clip(shares, 1e-9, 1.0 - 1e-9)
    if not study.correlations:
        return shares
    names = [entry.input for entry in study.uncertain]
    root = np.linalg.cholesky(normal_scores_correlation(names, study.correlations))
    return np.asarray(special.ndtr(special.ndtri(shares) @ root.T))


def draws(study: Study, n_sets: int | None = None) -> np.ndarray:
    """Values [E, D] of the uncertain inputs, in the order of the file."""
    return _values(study, unit_draws(study, n_sets))


def _values(study: Study, shares: np.ndarray) -> np.ndarray:
    columns = [entry.built().quantile(shares[:, d]) for d, entry in enumerate(study.uncertain)]
    return np.stack(columns, axis=1)


def all_sets(study: Study) -> list[ParameterSet]:
    """Every parameter set of ``study``; without uncertain inputs one, the study itself.

    Raises
    ------
    InputError
        A draw that the study would refuse (inputs that are each possible may not be together).
    """
    if study.grounds_table is not None:
        from mcsettle.study_grounds import ground_sets

        return ground_sets(study)
    if not study.uncertain:
        return [ParameterSet(0, {}, study)]
    shares = unit_draws(study)
    pairs = zip(shares, _values(study, shares), strict=True)
    return [_parameter_set(study, e, *pair) for e, pair in enumerate(pairs)]


def _parameter_set(study: Study, index: int, shares: np.ndarray, row: np.ndarray) -> ParameterSet:
    names = [entry.input for entry in study.uncertain]
    drawn = dict(zip(names, shares.tolist(), strict=True))
    values = {
        path: float(value)
        for entry, value in zip(study.uncertain, row, strict=True)
        for path in entry.paths
    }
    try:
        return ParameterSet(index, values, study.with_inputs(values), drawn)
    except InputError as error:
        reason = "\n".join(str(error).splitlines()[1:])
        raise InputError(
            f"parameter set {index} cannot be used:\n{reason}\n"
            "narrow the distributions that lead there, or correlate them"
        ) from None
