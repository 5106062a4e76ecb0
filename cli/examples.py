"""An example of every command, in the order in which they can be tried: the end of each help text."""

from collections.abc import Mapping

EXAMPLES: Mapping[str, str] = {
    "init": "mcsettle init study.toml",
    "schema": "mcsettle schema > study.schema.json",
    "check": "mcsettle check study.toml",
    "plan": "mcsettle plan study.toml",
    "track": "mcsettle track study.toml",
    "run": "mcsettle run study.toml --out results",
    "status": "mcsettle status results",
    "gather": "mcsettle gather results",
    "summarise": "mcsettle summarise results --picture answer.png",
    "report": "mcsettle report results",
    "export": "mcsettle export results --csv tables",
    "compare": "mcsettle run study.toml --seed 2 --out other && mcsettle compare results other",
    "calibrate": "mcsettle calibrate study.toml --scenario v201 --median-days 697",
    "life": 'mcsettle init life.toml && printf \'[maintenance]\\nrecovery = "linear"\\n'
    "intercept_mm = 0.4\\nslope = 0.3\\n' >> life.toml && mcsettle life life.toml",
    "sections": "mcsettle init --example line && mcsettle sections line.toml",
    "grounds": "mcsettle init --example prorail && mcsettle grounds prorail.toml",
    "tornado": "mcsettle init --example toy_uncertain && mcsettle tornado toy_uncertain.toml",
    "profile": "mcsettle init --example validation && mcsettle profile validation/record.csv",
    "validate": "mcsettle validate layered_bessel",
    "doctor": "mcsettle doctor",
}
