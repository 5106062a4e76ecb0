"""Observations as Step B predicts them at any settlement factor, other inputs as they are."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from mcsettle.estimate.likelihood import Likelihood, likelihood_of
from mcsettle.estimate.observation import Observation
from mcsettle.railway.scene import Scene
from mcsettle.step_a.transfers import StepA
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Case, Outcome, support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.sd_map import roughness
from mcsettle.units import MM

FAR = 8.0  # errors beyond every observed SD a track is followed no further
LONGER = 3.0  # than the interval observed: so far a track is followed
NO_LIMIT = 1.0  # m of SD: what grows until a day does not end at the tamping limit
TAMPED = 10_000_000  # profiles that tampings leave have addresses from here on


class FactorModel:
    """What the tracks of one variant do at any factor.

    Parameters
    ----------
    scenes : all of one variant, of every scenario observed
    prepared : their Step A
    observations : Observation
    """

    def __init__(
        self, scenes: Sequence[Scene], prepared: StepA, observations: Sequence[Observation]
    ) -> None:
        names = {o.scenario for o in observations}
        self.cases = {s.scenario: build_case(s, prepared) for s in scenes if s.scenario in names}
        self.scene = scenes[0]  # tracks and their support are the same in every scenario
        self.observations = tuple(observations)

    def of(self, observations: Sequence[Observation]) -> "FactorModel":
        """The model of some of the observations."""
        fewer = copy(self)
        fewer.observations = tuple(observations)
        return fewer

    def likelihood(self, logs: np.ndarray, wanted: np.ndarray, n_tracks: int) -> Likelihood:
        """Likelihood at the log factors ``wanted`` [W], from Step B at ``logs`` [F]."""
        values = dict(zip(self.observations, self.predicted(logs, wanted, n_tracks), strict=True))
        return likelihood_of(self.observations, values.__getitem__)

    def predicted(self, logs: np.ndarray, wanted: np.ndarray, n_tracks: int) -> list[np.ndarray]:
        """What each observation is compared with, [W, R]; NaN where the track failed."""
        profiles = self.scene.profiles.sample(range(n_tracks))
        recorded = [o for o in self.observations if not o.is_interval and o.is_recorded]
        sds = {
            name: self._sds(name, np.exp(logs), profiles)
            for name in dict.fromkeys(o.scenario for o in recorded)
        }
        repeated = {(o.scenario, o.day) for o in self.observations if o.quantity == "repetition"}
        grown: dict[tuple[str, float], dict[str, np.ndarray]] = {}
        values = []
        for observation in self.observations:
            if observation.day is None:
                log_days = self._log_days(observation, np.exp(logs), profiles)
                values.append(np.exp(_between(logs, log_days, wanted)))
            elif observation.quantity == "sd":
                values.append(_between(logs, sds[observation.scenario][observation.day], wanted))
            else:
                key = observation.scenario, observation.day
                if key not in grown:
                    grown[key] = self._grown(*key, key in repeated, np.exp(logs), profiles)
                values.append(_between(logs, grown[key][observation.quantity], wanted))
        return values

    def _log_days(
        self, observation: Observation, factors: np.ndarray, profiles: np.ndarray
    ) -> np.ndarray:
        """Log days [F, R] to the limit, of a track that outlives the horizon those of the horizon."""
        case = self.cases[observation.scenario]
        horizon = min(case.horizon, LONGER * observation.value)
        outcome = self._advanced(replace(case, horizon=horizon), factors, profiles, np.zeros(0))
        days = np.where(outcome.reached, outcome.days, horizon)
        log_days = np.where(outcome.failed, np.nan, np.log(np.maximum(days, 1e-9)))
        return log_days.reshape(len(factors), -1)

    def _grown(
        self, scenario: str, day: float, repeated: bool, factors: np.ndarray, profiles: np.ndarray
    ) -> dict[str, np.ndarray]:
        """What grew until ``day``, [F, R]: settlement [mm], SD of the increment [mm], repetition.

        The tamping between the two increments of ``repeated`` leaves a new profile of the spectrum, and
        the support as it persists; the ballast's count begins anew, that of the ground goes on.
        """
        case = replace(self.cases[scenario], sd_limit=NO_LIMIT, horizon=day)
        measure = roughness(case.wavenumbers, case.window)
        shape = len(factors), len(profiles)

        def increment(start: np.ndarray, tamping: int) -> tuple[Outcome, np.ndarray]:
            outcome = self._advanced(case, factors, start, np.zeros(0), tamping, day * tamping)
            added = measure.embed(outcome.amplitudes - np.tile(start, (len(factors), 1)))
            lost = outcome.failed | outcome.reached
            return outcome, np.where(lost[:, None], np.nan, added).reshape(*shape, -1)

        outcome, first = increment(profiles, 0)
        size = np.sqrt(np.sum(first**2, axis=2))
        settled = np.where(np.isnan(size), np.nan, outcome.mean_settlement.reshape(shape))
        grown = {"settlement": settled / MM, "increment": size / MM}
        if repeated:
            tamped = self.scene.profiles.sample(range(TAMPED, TAMPED + len(profiles)))
            _, second = increment(tamped, 1)
            product = np.sum(first * second, axis=2)
            grown["repetition"] = product / (size * np.sqrt(np.sum(second**2, axis=2)))
        return grown

    def _sds(
        self, scenario: str, factors: np.ndarray, profiles: np.ndarray
    ) -> dict[float, np.ndarray]:
        """SDs [F, R] mm by day observed; of a track beyond all that was observed, the highest."""
        observed = [
            o
            for o in self.observations
            if o.scenario == scenario and o.day is not None and o.quantity == "sd"
        ]
        days = np.unique([o.day for o in observed if o.day is not None])
        case = self.cases[scenario]
        limit = max(case.sd_limit, *((o.value + FAR * o.error) * MM for o in observed))
        case = replace(case, sd_limit=limit, horizon=max(1.001 * float(days[-1]), 1.0))
        outcome = self._advanced(case, factors, profiles, days)
        sd = np.where(np.isnan(outcome.history), limit, outcome.history) / MM
        sd = np.where(outcome.failed[:, None], np.nan, sd).reshape(len(factors), -1, len(days))
        return {float(day): sd[:, :, place] for place, day in enumerate(days)}

    def _advanced(
        self,
        case: Case,
        factors: np.ndarray,
        profiles: np.ndarray,
        days: np.ndarray,
        tamping: int = 0,
        ground_days: float = 0.0,
    ) -> Outcome:
        """Every track at every factor, factors outermost; SDs recorded on ``days``.

        After ``tamping`` tampings, the ground having had ``ground_days`` of traffic before.
        """
        model = replace(case.model, settlement_factor=1.0)
        machine = CycleJump(replace(case, model=model))
        support = support_of(self.scene, range(len(profiles)), profiles, tamping)
        again = np.tile(np.arange(len(profiles)), len(factors))
        each = np.repeat(factors, len(profiles))
        before = np.full(len(again), ground_days) if ground_days else None
        return machine.run(profiles[again], days, each, before, support[again])


def _between(logs: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Values [W, R] at ``wanted``, linear between those [F, R] at ``logs``."""
    return np.stack([np.interp(wanted, logs, column) for column in values.T], axis=1)
