"""Observations as people have them: dates, decimal commas, serials; all faults of a file at once."""

from pathlib import Path

import pytest

from mcsettle.cli.observations import read_observations
from mcsettle.errors import InputError


def written(path: Path, text: str, encoding: str = "utf-8") -> str:
    path.write_bytes(text.encode(encoding))
    return str(path)


@pytest.mark.parametrize(
    ("text", "dates"),
    [
        ("day,sd_mm,sd_error_mm\n2021-03-05,1.03,0.05\n2021-09-11,1.12,0.05\n", "iso"),
        ("Date,SD_mm,sd_error_mm\n2021-09-11,1.12,0.05\n2021-03-05,1.03,0.05\n", "iso"),
        ("date;sd_mm;sd_error_mm\n05.03.2021;1,03;0,05\n11.09.2021;1,12;0,05\n", "day_first"),
        ("date\tsd_mm\tsd_error_mm\n3/5/2021\t1.03\t0.05\n9/11/21\t1.12\t0.05\n", "month_first"),
        ("day;sd_mm;sd_error_mm\n0;1,03;0,05\n190;1,12;0,05\n", "iso"),
    ],
)
def test_days_and_dates(tmp_path: Path, text: str, dates: str) -> None:
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        rows = read_observations(written(tmp_path / "a.csv", text, encoding), dates)
        assert [(row.day, row.value, row.error) for row in rows] == [
            (0, 1.03, 0.05),
            (190, 1.12, 0.05),
        ]


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (
            "05/03/2021,1.03,0.05\n11/09/2021,1.12,0",
            ("3 faults", "is not ISO", 'dates = "day_first"'),
        ),
        ("44260,1.03,0.05\n44450,1.12,0.05", ("spreadsheet's serial", "2021-03-05")),
        ("0,1.03,0\n365,x,0.05", ("2 faults", "row 1:", "row 2: received 365, x, 0.05")),
        ("0,1.03,0", ("scatter of repeated recordings",)),
        ("0,1.03", ("row 1 has fewer cells",)),
    ],
)
def test_what_cannot_be_is_said_all_at_once(
    tmp_path: Path, rows: str, said: tuple[str, ...]
) -> None:
    path = written(tmp_path / "a.csv", f"day,sd_mm,sd_error_mm\n{rows}\n")
    with pytest.raises(InputError) as caught:
        read_observations(path)
    for part in said:
        assert part in str(caught.value)


def test_a_workbook_of_other_columns_is_told_which_it_needs(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "Date;SD left;Tamped\n05/03/2021;1,03;0\n")
    with pytest.raises(
        InputError, match=r"no column sd_mm, sd_error_mm; its columns: Date, SD left"
    ):
        read_observations(path, "day_first")
    path = written(tmp_path / "b.csv", "day;sd_mm;Fehler_ü\n0;1;0\n", "cp1252")
    with pytest.raises(InputError, match=r"byte 0xfc.*'day;sd_mm;Fehler_ü'"):
        read_observations(path)
