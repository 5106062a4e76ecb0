"""Uncertain inputs of a study: their correlation, and a study with drawn values in their place."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcsettle.errors import InputError
from mcsettle.study.key_paths import replaced, steps_to, value_at
from mcsettle.study.schema.study import StudyTables
from mcsettle.study.schema.uncertain import CorrelationTable

FACTOR = "settlement_factor"
LEAST_EIGENVALUE = 1e-9


def normal_scores_correlation(
    names: Sequence[str], correlations: Sequence[CorrelationTable]
) -> np.ndarray:
    """Correlation [D, D] of the normal scores that gives the rank correlations (Gaussian copula).

    A rank correlation ρ of normal variables belongs to a correlation 2 sin(πρ/6).

    Raises
    ------
    InputError
        The matrix is not positive definite.
    """
    matrix = _scores(names, correlations, 1.0)
    lowest = _lowest(matrix)
    if lowest < LEAST_EIGENVALUE:
        shares = np.linspace(0.0, 1.0, 1001)
        valid = [s for s in shares if _lowest(_scores(names, correlations, s)) >= LEAST_EIGENVALUE]
        raise InputError(
            "these rank correlations cannot hold together: the matrix of their normal scores, "
            f"2 sin(πρ/6), is not positive definite (lowest eigenvalue {lowest:.3g}). "
            f"Multiplied by {valid[-1]:.3f} they can; or bring single ones nearer to 0, or "
            "correct their signs"
        )
    return matrix


def _scores(
    names: Sequence[str], correlations: Sequence[CorrelationTable], share: float
) -> np.ndarray:
    """Correlations [D, D] of the normal scores for a ``share`` of the rank correlations."""
    matrix = np.eye(len(names))
    for entry in correlations:
        i, j = (names.index(name) for name in entry.inputs)
        matrix[i, j] = matrix[j, i] = 2.0 * np.sin(np.pi * share * entry.rank / 6.0)
    return matrix


def _lowest(matrix: np.ndarray) -> float:
    return float(np.linalg.eigvalsh(matrix)[0]) if len(matrix) else 1.0


def with_values(data: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, Any]:
    """Study data with the inputs at the key paths ``values`` replaced: nothing uncertain, or observed.

    A whole number stays one where the study has one.
    """
    result: Any = {
        k: v for k, v in data.items() if k not in ("uncertain", "correlations", "observed")
    }
    result["run"] = {k: v for k, v in data.get("run", {}).items() if k != "parameter_sets"}
    for path, value in values.items():
        steps = steps_to(result, path)
        assert steps is not None, path
        whole = isinstance(value_at(result, steps), int) and float(value).is_integer()
        result = replaced(result, steps, int(value) if whole else float(value))
    return dict(result)


def followers(variants: Sequence[Any], path: str) -> list[str]:
    """Names of the variants whose settlement factor is that at the key path ``path``."""
    if path == f"settlement.{FACTOR}":
        return [v.name for v in variants if getattr(v, FACTOR) is None]
    return [v.name for v in variants if path == f"variants.{v.name}.{FACTOR}"]


def uncertain_settlement(study: StudyTables) -> set[str]:
    """Keys of ``[settlement]`` that are uncertain: a variant without its own follows them."""
    paths = (path.split(".") for entry in study.uncertain for path in entry.paths)
    return {steps[1] for steps in paths if len(steps) == 2 and steps[0] == "settlement"}


def has_uncertain_traffic(study: StudyTables) -> bool:
    """Whether what the economics take from the timetable differs between parameter sets."""
    roots = {path.split(".")[0] for entry in study.uncertain for path in entry.paths}
    return bool(roots & {"trains", "scenarios"})
