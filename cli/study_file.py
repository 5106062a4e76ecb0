"""The study that a command is given, and what is said when it is read."""

from pathlib import Path
from typing import TYPE_CHECKING

from mcsettle.cli.terminal import inform

if TYPE_CHECKING:
    from mcsettle.study.study import Study


def study_in(path: Path) -> "Study":
    """The study file at ``path``; says so where its sample is capped.

    Raises
    ------
    InputError
        As ``load_study``.
    """
    from mcsettle.study.sample_cap import VARIABLE, sample_cap
    from mcsettle.study.study import load_study

    study = load_study(path)
    if (cap := sample_cap()) is not None:
        inform(f"{VARIABLE} is set: at most {cap} realisations and parameter sets.")
    return study
