"""What a model form assumes is said where the forms differ, and measurements follow from it."""

import made_run

from mcsettle.report.assumptions import assumptions, beside, differing, told_apart


def test_forms_are_told_apart_by_what_differs() -> None:
    variants = [
        {"name": "plain"},
        {"name": "varied", "spatial_variability": {"cov": 0.1, "correlation_length_m": 5.0}},
        {
            "name": "counted",
            "cycles": "equivalent",
            "equivalence_exponent": 3.0,
            "equivalence_history": "mix",
        },
        {"name": "total", "stress": "total", "rail_bending_share": 1.0},
    ]
    study = made_run.tonnage_study(variants=variants)
    names = [variant["name"] for variant in variants]
    assert differing(study, names) == ["stress", "support", "rail", "cycles"]
    assert "linear ground" not in told_apart(study, "plain", names)
    assert told_apart(study, "varied", names).split(", ")[1] == "support varies 10 %"
    assert "equivalent axles, n = 3" in told_apart(study, "counted", names)
    assert "rail bending 1" in told_apart(study, "total", names)
    assert all(len(words.split()) <= 5 for words in assumptions(study, "plain").values())
    assert beside(study, "varied", "plain") == "support varies 10 %"
    assert beside(study, "total", "plain") == "total stress, rail bending 1"
    assert told_apart(study, "plain", ["plain"]) == "linear ground, traffic stress"
