"""Observations of what has grown: levelling, increments and how they repeat after a tamping."""

from dataclasses import replace

import numpy as np
import pytest
import toy
from toy import FITTED, INTERVAL, N0

from mcsettle.errors import InputError
from mcsettle.estimate.observation import Observation
from mcsettle.run.factor_model import FactorModel
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.case import support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.units import MM

FIELD = {"cov": 0.3, "correlation_length_m": 5.0, "distribution": "lognormal"}
LEVELLED = {"scenario": "v201", "day": 20.0, "settlement_mm": 12.0, "settlement_error_mm": 0.5}
INCREMENT = {"scenario": "v201", "day": 20.0, "increment_sd_mm": 0.5, "increment_error_mm": 0.05}
REPEATED = {
    "scenario": "v201",
    "day": 20.0,
    "increment_correlation": 0.8,
    "correlation_error": 0.1,
}
TRACKS = 6


def model_of(*entries: Observation, **changes) -> FactorModel:
    study = toy.study(**changes)
    scenes = [study.scene(study.variant_names[0], "v201")]
    return FactorModel(scenes, step_a(scenes), entries)


def observation(quantity: str) -> Observation:
    return Observation(20.0, 1.0, 0.1, "v201", quantity=quantity)


def test_levelling_and_increments_are_those_of_the_engine() -> None:
    entries = observation("settlement"), observation("increment")
    model = model_of(*entries, spatial_variability=FIELD)
    logs = np.log([150.0, 300.0])
    settled, added = model.predicted(logs, logs, TRACKS)
    case, scene = model.cases["v201"], model.scene
    profiles = scene.profiles.sample(range(TRACKS))
    support = support_of(scene, range(TRACKS), profiles)
    for row, factor in enumerate([150.0, 300.0]):
        own = replace(case.model, settlement_factor=factor)
        engine = CycleJump(replace(case, model=own, horizon=20.0, sd_limit=1.0))
        outcome = engine.run(profiles, np.zeros(0), support=support)
        np.testing.assert_allclose(settled[row], outcome.mean_settlement / MM, rtol=1e-9)
        sd = engine.measure.sd(outcome.amplitudes - profiles) / MM
        np.testing.assert_allclose(added[row], sd, rtol=1e-9)


def test_increments_repeat_where_the_support_varies_and_not_without() -> None:
    logs = np.log([30.0])
    means = []
    for changes in ({}, {"spatial_variability": FIELD}):
        (repeated,) = model_of(observation("repetition"), **changes).predicted(logs, logs, 24)
        assert np.all(np.abs(repeated) <= 1.0)
        means.append(float(repeated.mean()))
    assert abs(means[0]) < 0.2
    assert means[1] > 0.8


def test_the_likelihood_of_one_section_has_one_track() -> None:
    """Levelling and increment of one section: the product, track by track, before the mean."""
    a = replace(observation("settlement"), section="1", value=12.0, error=1.0)
    b = replace(observation("increment"), section="1", value=0.5, error=0.1)
    model = model_of(a, b, spatial_variability=FIELD)
    logs = np.log([300.0])
    settled, added = model.predicted(logs, logs, TRACKS)
    logs_of = -0.5 * ((settled - 12.0) ** 2 + ((added - 0.5) / 0.1) ** 2)
    expected = np.log(np.mean(np.exp(logs_of)))
    assert model.likelihood(logs, logs, TRACKS).plain()[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (LEVELLED | {"day": 0.0}, "day must be above 0"),
        (LEVELLED | {"sd_mm": 1.0}, "an observation is either"),
        ({k: v for k, v in INCREMENT.items() if k != "increment_error_mm"}, "increment_error_mm"),
        (REPEATED | {"increment_correlation": 1.2}, "less than or equal to 1"),
        (LEVELLED | {"day": 1e4}, "followed for 730 days"),
    ],
)
def test_what_cannot_be_is_refused(entry, said) -> None:
    with pytest.raises(InputError, match=said):
        toy.uncertain(N0, FITTED, observed=[entry])


def test_they_need_a_fitted_factor() -> None:
    toy.uncertain(N0, FITTED, observed=[LEVELLED, INCREMENT, REPEATED, INTERVAL])
    with pytest.raises(InputError, match="every parameter set fits"):
        toy.uncertain(N0, observed=[LEVELLED])
