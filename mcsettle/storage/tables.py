"""The result tables: columns, types, units, meaning. Data dictionary and Arrow schemas follow.

One row per thing. A unit stands in the column's name, in the Arrow field's metadata and in the data
dictionary. The keys of a table name a row once and for all.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import pyarrow as pa

TEXT, COUNT, NUMBER = pa.string(), pa.int64(), pa.float64()
INPUT = "input_"
CURRENCY = "currency"  # in a unit: stands for the code of the study's currency


@dataclass(frozen=True)
class Column:
    """One column: ``unit`` is "1" for a number without dimension and "" where none applies."""

    name: str
    type: pa.DataType
    unit: str
    meaning: str
    nullable: bool = False

    def field(self, currency: str = "") -> pa.Field:
        """The Arrow field, with unit and meaning in its metadata; prices are in ``currency``."""
        metadata = {"unit": in_currency(self.unit, currency), "description": self.meaning}
        return pa.field(self.name, self.type, self.nullable, metadata)


@dataclass(frozen=True)
class TableShape:
    """A table's columns in order; the first ``n_keys`` of them are its keys."""

    columns: tuple[Column, ...]
    n_keys: int

    @property
    def keys(self) -> list[str]:
        """Names of the key columns."""
        return [column.name for column in self.columns[: self.n_keys]]


_SCENE = (
    Column("variant", TEXT, "", "variant of the study's settings"),
    Column("scenario", TEXT, "", "scenario of the study: a timetable"),
)
_SET = Column(
    "parameter_set", pa.int32(), "", "draw of the uncertain inputs; 0 if none is uncertain"
)
_REALISATION = Column(
    "realisation", COUNT, "", "realisation index; the same index is the same initial track"
)

TABLES = {
    "realisations": TableShape(
        (
            *_SCENE,
            _SET,
            _REALISATION,
            Column("status", TEXT, "", "reached, censored (horizon came first) or failed"),
            Column("tamping_interval_days", NUMBER, "d", "time to reach the SD limit", True),
            Column(
                "censored_at_days", NUMBER, "d", "horizon, where the limit was not reached", True
            ),
            Column("passages", COUNT, "1", "axle passages to the end"),
            Column("tonnage_mgt", NUMBER, "MGT", "gross tonnage to the end"),
            Column("sd_initial_mm", NUMBER, "mm", "SD of the profile at the start"),
            Column("sd_final_mm", NUMBER, "mm", "SD of the profile at the end"),
            Column("mean_settlement_mm", NUMBER, "mm", "uniform settlement to the end"),
            Column("sd_growth_1y_mm", NUMBER, "mm", "growth of SD in the first 365 days", True),
            Column("failure", TEXT, "", "why a failed realisation failed", True),
        ),
        4,
    ),
    "history": TableShape(
        (
            *_SCENE,
            _SET,
            _REALISATION,
            Column("day", NUMBER, "d", "time since the start"),
            Column("sd_mm", NUMBER, "mm", "SD of the profile"),
        ),
        5,
    ),
    "effects": TableShape(
        (
            *_SCENE,
            Column("baseline", TEXT, "", "scenario it is compared with, on the same tracks"),
            _SET,
            _REALISATION,
            Column(
                "status",
                TEXT,
                "",
                "paired, censored (either), at_limit (before any traffic) or failed",
            ),
            Column("effect", TEXT, "", "what the scenario changes: speed or tonnage"),
            Column("reduction_percent", NUMBER, "%", "reduction of the tamping interval", True),
            Column("elasticity", NUMBER, "1", "deterioration elasticity", True),
            Column(
                "marginal_cost",
                NUMBER,
                f"{CURRENCY} per km/h per 1000 train-km (speed) or per 1000 tonne-km (tonnage)",
                "marginal cost of tamping",
                True,
            ),
        ),
        5,
    ),
    "sign_split": TableShape(
        (
            *_SCENE,
            Column("baseline", TEXT, "", "scenario whose services are kept"),
            _REALISATION,
            Column("status", TEXT, "", "paired, or censored (any of the four runs)"),
            Column("reduction_percent", NUMBER, "%", "reduction of the tamping interval", True),
            Column(
                "reduction_by_roughening_percent",
                NUMBER,
                "%",
                "by the axles of added services, their cycles not counted",
                True,
            ),
            Column(
                "reduction_by_hardening_percent",
                NUMBER,
                "%",
                "by the cycles of added services, their axles not settling the track",
                True,
            ),
            Column(
                "roughening_ratio",
                NUMBER,
                "1",
                "what an added axle roughens over a baseline's",
                True,
            ),
            Column(
                "break_even_ratio",
                NUMBER,
                "1",
                "roughening ratio at which the interval would not change",
                True,
            ),
            Column(
                "leverage", NUMBER, "1", "change of the interval over a small one of the rate", True
            ),
        ),
        4,
    ),
    "parameters": TableShape(
        (
            _SET,
            Column("input", TEXT, "", "key path of an uncertain input of the study"),
            Column("value", NUMBER, "see unit", "value drawn"),
            Column("unit", TEXT, "", "unit of value"),
        ),
        2,
    ),
    "fits": TableShape(
        (
            Column("variant", TEXT, "", "variant of the study's settings"),
            _SET,
            Column("input", TEXT, "", "key path of the settlement factor that was fitted"),
            Column("value", NUMBER, "1", "factor, drawn from what the observations leave of it"),
            Column("log_evidence", NUMBER, "1", "of what was observed; null: not possible", True),
        ),
        2,
    ),
    "weights": TableShape(
        (
            Column("variant", TEXT, "", "variant of the study's settings"),
            _SET,
            Column("weight", NUMBER, "1", "share of the weight, given what was observed"),
            Column("log_likelihood", NUMBER, "1", "of what was observed; null: not possible", True),
        ),
        2,
    ),
    "summary": TableShape(
        (
            *_SCENE,
            Column(
                "baseline", TEXT, "", "of an effect: what the scenario is compared with; else empty"
            ),
            Column("metric", TEXT, "", "what is estimated: a column of another table"),
            Column("statistic", TEXT, "", "what of it: quantile, mean, variance share, …"),
            Column("subject", TEXT, "", "an input, or a length of line; else empty"),
            Column("level", NUMBER, "1", "level of a quantile", True),
            Column("value", NUMBER, "see unit", "estimate; null where not identified", True),
            Column("lo", NUMBER, "see unit", "lower 95 % confidence limit; null: open", True),
            Column("hi", NUMBER, "see unit", "upper 95 % confidence limit; null: open", True),
            Column("standard_error", NUMBER, "see unit", "Monte Carlo error; null: unknown", True),
            Column("n", COUNT, "1", "realisations behind the estimate"),
            Column("n_censored", COUNT, "1", "of them censored"),
            Column("unit", TEXT, "", "unit of value, limits and error"),
            Column("note", TEXT, "", "what to know about this estimate; may be empty"),
        ),
        7,
    ),
}


def schema_of(
    table: str, columns: Iterable[str], currency: str = "", units: Mapping[str, str] | None = None
) -> pa.Schema:
    """Arrow schema of ``table``; the ``input_…`` ones among ``columns`` follow its own.

    Only ``realisations`` has them: one for each uncertain input of the study, ``units`` by column.
    ``currency`` of the prices.
    """
    meaning = "uncertain input of this row's parameter set (table parameters)"
    drawn = [
        Column(name, NUMBER, (units or {}).get(name, "1"), meaning)
        for name in columns
        if table == "realisations" and name.startswith(INPUT)
    ]
    return pa.schema([column.field(currency) for column in (*TABLES[table].columns, *drawn)])


def data_dictionary(currency: str = "") -> str:
    """CSV text: table, column, type, unit, nullable, key, description, one line a column."""
    lines = ["table,column,type,unit,nullable,key,description"]
    for name, shape in TABLES.items():
        for column in shape.columns:
            key = "yes" if column.name in shape.keys else "no"
            nullable = "yes" if column.nullable else "no"
            unit = in_currency(column.unit, currency)
            lines.append(
                f'{name},{column.name},{column.type},"{unit}",{nullable},{key},"{column.meaning}"'
            )
    return "\n".join(lines) + "\n"


def in_currency(unit: str, code: str) -> str:
    """``unit`` with the code of a currency, where it has one and the code is given.

    >>> in_currency("currency/track-km", "SEK"), in_currency("currency/track-km", "")
    ('SEK/track-km', 'currency/track-km')
    """
    return unit.replace(CURRENCY, code) if code else unit


def input_column(path: str) -> str:
    """Column of ``realisations`` that holds an uncertain input.

    >>> input_column("track.layers.subgrade.settlement_b")
    'input_track_layers_subgrade_settlement_b'
    """
    return "input_" + "".join(c if c.isalnum() else "_" for c in path)
