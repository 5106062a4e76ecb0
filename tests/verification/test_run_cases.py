"""The verification cases by name, and their table."""

import pytest

from mcsettle.verification.case import Case, worst_point, worst_ratio
from mcsettle.verification.closed_form_cases import CLOSED_CASES
from mcsettle.verification.run_cases import CASES, run_cases, table
from mcsettle.verification.section_cases import SECTION_CASES


@pytest.mark.parametrize("name", CLOSED_CASES)
def test_closed_forms(name):
    (case,) = run_cases([name])
    assert case.passed, table([case])


@pytest.mark.slow
@pytest.mark.parametrize("name", SECTION_CASES)
def test_section(name):
    (case,) = run_cases([name])
    assert case.passed, table([case])


def test_all_cases_are_listed_once():
    assert list(CASES) == [*CLOSED_CASES, *SECTION_CASES]


def test_order_is_that_of_the_list_and_names_are_checked():
    names = ["passenger_wheelset", "freight_frequencies"]
    assert [case.name for case in run_cases(names)] == names[::-1]
    with pytest.raises(ValueError, match="unknown case nothing; choose from strip_plane_strain"):
        run_cases(["nothing"])


def test_worst_point_of_a_curve():
    case = worst_point("a", "b", [1.0, -4.0, 0.0], [1.0, -4.1, 0.3], 0.1, "m")
    assert (case.expected, case.obtained, case.scale) == (0.0, 0.3, 4.0)
    assert case.error == pytest.approx(0.075)
    assert case.passed


def test_worst_ratio_of_a_curve():
    case = worst_ratio("a", "b", [1.0, -4.0], [1.2, -4.4], 0.1, "m")
    assert (case.expected, case.obtained) == (1.0, 1.2)
    assert not case.passed


def test_nan_fails():
    assert not Case("a", "b", 1.0, float("nan"), 1.0, "m", 1.0).passed


def test_table_reads():
    cases = [
        Case("good", "book", 2.0, 2.0 + 0.001j, 1e-2, "m", 2.0),
        Case("bad", "book", 1.0, 2.0, 1e-2, "m", 1.0),
    ]
    lines = table(cases).splitlines()
    assert lines[1].split() == ["good", "2", "2+0.001i", "m", "5.0e-04", "1e-02", "ok", "book"]
    assert "FAILED" in lines[2]
    assert lines[3] == "1 of 2 cases within tolerance"
