"""The script behind docs/plausibility.md: its statistics, and that every form is a valid study."""

import numpy as np
import pytest

from studies import plausibility


def test_an_exponent_and_its_error() -> None:
    rng = np.random.default_rng(1)
    base = np.exp(0.3 * rng.normal(size=400))
    noise = np.exp(0.01 * rng.normal(size=400))
    value, error = plausibility.exponent(base * 1.1**2.5 * noise, base, 1.1).split(" ± ")
    assert float(value) == pytest.approx(2.5, abs=3.0 * float(error))
    assert 0.0 < float(error) < 0.05
    base[0] = np.nan  # a track without a rate counts in neither
    assert plausibility.exponent(base * 1.1**2, base, 1.1).startswith("2.00 ± 0.00")


def test_quantiles_and_sd() -> None:
    assert plausibility.quantiles(np.arange(101.0), 0) == "50 (5 to 95)"
    np.testing.assert_allclose(plausibility.root_sum(np.array([[3.0, 4.0j]])), [np.sqrt(12.5)])


@pytest.mark.parametrize(
    ("name", "form"), list(plausibility.forms()), ids=lambda value: str(value)[:12]
)
def test_every_form_is_a_study(name: str, form: dict) -> None:
    study = plausibility.study_of(form, 8)
    assert study.variant_names == ("form",), name
    assert study.scenario_names == ("base", "fast", "heavy", "freight")
    assert study.run.realisations == 8
    assert study.settlement_settings("form").settlement_factor == 1.0


def test_what_is_measured_names_rows_of_the_table() -> None:
    """Every row with a measured value beside it is one that is computed."""
    rows = set(plausibility.MEASURED)
    text = (plausibility.Path(plausibility.__file__)).read_text(encoding="utf-8")
    assert all(text.count(f'"{row}"') >= 2 for row in rows)
