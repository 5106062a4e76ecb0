"""Records as people have them: each kind of notation or fault gives its SDs, or a refusal to act on.

One track of waves with known SDs of its 200 m sections is written in the way of each case.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.errors import InputError
from mcsettle.railway.filters import Band
from mcsettle.railway.irregularity import sample_profiles, to_space, wavenumbers
from mcsettle.railway.measured_profiles import Record, RecordChoice, prepared
from mcsettle.railway.read_record import RecordFormat, read_record
from mcsettle.railway.record_findings import findings
from mcsettle.railway.spectra import spectrum

LENGTH, STEP = 1200.0, 0.25
MODES = wavenumbers(200.0)
X = np.arange(0.0, LENGTH, STEP)
IDEAL = Band()
runner = CliRunner()


def track(x: np.ndarray, seed: int = 4) -> np.ndarray:
    """Level [N] m of waves from 1 to 30 m at ``x`` [N] m of a track of 1200 m."""
    k = wavenumbers(LENGTH, 1.0, 30.0)
    return to_space(sample_profiles(spectrum("fra", 6), k, LENGTH, seed, [0]), k, x)[0]


def truth(seed: int = 4, shortest: float = 3.0, longest: float = 35.0) -> np.ndarray:
    """SD [6] m of each 200 m of the same track in the band."""
    k = wavenumbers(LENGTH, 1.0, 30.0)
    amplitudes = sample_profiles(spectrum("fra", 6), k, LENGTH, seed, [0])
    inside = (k > 2 * np.pi / longest - 1e-9) & (k < 2 * np.pi / shortest + 1e-9)
    return to_space(amplitudes[:, inside], k[inside], X)[0].reshape(6, 800).std(axis=1)


LEVEL = track(X)
MM = LEVEL * 1e3


def file(path: Path, head: str, rows: Sequence[str], encoding: str = "utf-8") -> Path:
    path.write_bytes("\r\n".join([head, *rows, ""]).encode(encoding))
    return path


def record(
    path: Path,
    repair: tuple[str, ...] = (),
    band: Band = IDEAL,
    longest_gap: float = 5.0,
    **said: Any,
) -> Record:
    layout = RecordFormat(**said)
    return prepared(
        RecordChoice(path, str(path.stat().st_mtime_ns), layout, None, repair, longest_gap, band),
        200.0,
        wavenumbers(200.0, band.shortest, band.longest),
    )


def sds(path: Path, *repair: str, **said: Any) -> np.ndarray:
    return record(path, repair, **said).sections.sd


def comma(value: float, digits: int = 4) -> str:
    return f"{value:.{digits}f}".replace(".", ",")


# --- notations of the position ---------------------------------------------------------------------


def km_plus_m(x: float) -> str:
    return f"{752 + int(x // 1000)}+{x % 1000:07.2f}"


def test_a_recording_car_export_with_km_plus_m_and_words_for_no_reading(tmp_path: Path) -> None:
    """A line before the heading, decimal commas, both rails, units in brackets, CRLF."""
    rows = [
        f'{i};"001";{km_plus_m(x)};"60,0° N";{comma(z)};{comma(1.2 * z)}'.replace(".", ",")
        for i, (x, z) in enumerate(zip(X, MM, strict=True))
    ]
    for place, word in ((400, "epäluku"), (401, "epäluku"), (1200, "∞"), (1201, "")):
        parts = rows[place].split(";")
        rows[place] = ";".join([*parts[:4], word, word])
    head = (
        '"Date";"26/9/2023"\r\n"No";"Track";"Location [km+m]";"Lat";"Left D1 [mm]";"Right D1 [mm]"'
    )
    path = file(tmp_path / "car.csv", head, rows)
    with pytest.raises(InputError) as caught:
        record(path, chainage_column="Location [km+m]", level_column="Left D1 [mm]")
    for said in ("semicolon", "skip_rows = 1", "decimal", "missing_values"):
        assert said in str(caught.value) or said == "missing_values"
    said = {
        "chainage_column": "Location [km+m]",
        "level_column": "Left D1 [mm]",
        "second_level_column": "Right D1 [mm]",
        "separator": "semicolon",
        "decimal": ",",
        "skip_rows": 1,
    }
    with pytest.raises(InputError, match=r"'epäluku', '∞'.*missing_values = \[\"epäluku\"\]"):
        record(path, rails="mean", **said)
    said["missing_values"] = ("epäluku", "∞")
    for rails, factor in (("mean", 1.1), ("worse", 1.2)):
        found = record(path, ("missing", "gaps"), rails=rails, **said)
        np.testing.assert_allclose(found.sections.sd, factor * truth(), rtol=0.03)
        assert found.sections.chainage_from[0] == 752_000.0
        assert found.run.missing == 4
        assert any("is band-passed to D1" in remark for remark in found.remarks)


def miles_yards(x: float) -> str:
    yards = round(x / 0.9144) + 1000
    return f"{12 + yards // 1760}.{yards % 1760:04d}"


MILES_X = 0.9144 * np.arange(int(LENGTH / 0.9144))


def test_miles_and_yards_are_refused_as_decimal_miles_and_read_when_said(tmp_path: Path) -> None:
    rows = [
        f"T,{miles_yards(x)},{z:.4f}" for x, z in zip(MILES_X, track(MILES_X) * 1e3, strict=True)
    ]
    path = file(tmp_path / "mi.csv", "elr,mileage,top_mm", rows)
    said = {"chainage_column": "mileage", "level_column": "top_mm"}
    with pytest.raises(InputError, match=r"12\.1000 is 12 miles 1000 yards\); say .*\"mi\.yd\""):
        record(path, chainage_unit="mi", **said)
    found = record(path, chainage_unit="mi.yd", **said)  # over a milepost
    np.testing.assert_allclose(found.sections.sd[1:5], truth()[1:5], rtol=0.03)
    assert found.sections.chainage_from[0] == pytest.approx(12 * 1609.344 + 914.4)
    decimal = [f"T,{x / 1609.344:.6f},{z:.4f}" for x, z in zip(X, MM, strict=True)]
    path = file(tmp_path / "dec.csv", "elr,mileage,top_mm", decimal)
    np.testing.assert_allclose(sds(path, chainage_unit="mi", **said), truth(), rtol=0.03)
    with pytest.raises(InputError, match="a mile has 1760 yards: decimal miles are chainage_unit"):
        record(path, chainage_unit="mi.yd", **said)


def kilometres_of(lengths: Sequence[float], offset: float = 27_000.0) -> np.ndarray:
    """Chainage [N] m of ``X`` where the kilometres have these lengths [m]."""
    ends = np.cumsum(lengths)
    which = np.searchsorted(ends, X, side="right")
    starts = np.concatenate([[0.0], ends])
    return offset + 1000.0 * which + X - starts[which]


@pytest.mark.parametrize("length", [1050.0, 1000.75])
def test_a_long_kilometre_is_a_step_and_no_disorder(tmp_path: Path, length: float) -> None:
    chainage = kilometres_of([length, 1000.0])
    path = file(
        tmp_path / "a.csv",
        "chainage_m,level_mm",
        [f"{x:.2f},{z:.4f}" for x, z in zip(chainage, MM, strict=True)],
    )
    with pytest.raises(InputError, match=r"steps: 1 steps back .*repair = \['steps'\]"):
        record(path)
    found = record(path, ("steps",)).sections
    np.testing.assert_allclose(found.sd, truth(), rtol=0.03)
    assert len(found.sd) == 6
    assert found.chainage_to[-1] == pytest.approx(chainage[-1] + STEP)


def test_a_short_kilometre_is_no_gap_when_it_is_said(tmp_path: Path) -> None:
    chainage = kilometres_of([900.0, 1000.0])
    path = file(
        tmp_path / "a.csv",
        "chainage_m,level_mm",
        [f"{x:.2f},{z:.4f}" for x, z in zip(chainage, MM, strict=True)],
    )
    with pytest.raises(
        InputError, match=r"short_kilometres: 1 gaps of up to 100\.2 m .* at a post"
    ):
        record(path)
    np.testing.assert_allclose(sds(path, "short_kilometres"), truth(), rtol=0.03)
    with pytest.raises(InputError, match=r"a gap of 100\.2 m"):  # where readings are missing
        record(path, ("gaps",))


def test_a_car_that_went_back_is_told_from_a_long_kilometre(tmp_path: Path) -> None:
    again = np.concatenate([np.arange(0, 3000), np.arange(2600, len(X))])
    path = file(
        tmp_path / "a.csv", "chainage_m,level_mm", [f"{X[i]:.2f},{MM[i]:.4f}" for i in again]
    )
    (run,) = read_record(path, RecordFormat())
    assert [f.kind for f in findings(run)] == ["restarts"]
    np.testing.assert_allclose(sds(path, "restarts"), truth(), rtol=0.03)


# --- readings that are none ------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [1, 2, 12])
@pytest.mark.parametrize(
    ("mark", "kind"), [("-901", "implausible"), ("-99.99", "constant"), ("-9999", "implausible")]
)
def test_a_sentinel_is_found_named_and_never_a_spike(
    tmp_path: Path, mark: str, kind: str, rows: int
) -> None:
    cells = [f"{z:.3f}" for z in MM]
    cells[1000 : 1000 + rows] = [mark] * rows
    path = file(
        tmp_path / "a.csv",
        "chainage_m,level_mm",
        [f"{x},{z}" for x, z in zip(X, cells, strict=True)],
    )
    (run,) = read_record(path, RecordFormat())
    kinds = [f.kind for f in findings(run)]
    if rows == 1 and kind == "constant":  # one single value off is a spike
        assert kinds == ["spikes"]
    else:
        assert kinds == [kind, "gaps"]
        with pytest.raises(InputError, match=f"{kind}: {rows} readings .*missing_values"):
            record(path)
        np.testing.assert_allclose(sds(path, kind, "gaps"), truth(), rtol=0.03)
    for named in (mark, float(mark)):
        found = sds(path, "missing", "gaps", missing_values=(named,))
        np.testing.assert_allclose(found, truth(), rtol=0.03)


def test_a_stuck_reading_is_found_and_a_coarse_record_is_none(tmp_path: Path) -> None:
    stuck = MM.copy()
    stuck[2000:2040] = stuck[2000]
    (run,) = read_record(
        file(tmp_path / "a.csv", "chainage_m,level_mm",
             [f"{x},{z:.3f}" for x, z in zip(X, stuck, strict=True)]), RecordFormat()
    )  # fmt: skip
    assert [f.kind for f in findings(run)] == ["constant", "gaps"]
    (run,) = read_record(
        file(tmp_path / "b.csv", "chainage_m,level_mm",
             [f"{x},{z:.0f}" for x, z in zip(X, MM, strict=True)]), RecordFormat()
    )  # fmt: skip
    assert findings(run) == []


def test_the_largest_section_is_looked_at(tmp_path: Path) -> None:
    wild = MM.copy()
    wild[2400:3200] += 95.0 * np.sin(X[2400:3200])
    path = file(tmp_path / "a.csv", "chainage_m,level_mm",
                [f"{x},{z}" for x, z in zip(X, wild, strict=True)])  # fmt: skip
    with pytest.raises(InputError, match=r"largest from 600 m on\), which is no track's"):
        record(path)


# --- encodings -------------------------------------------------------------------------------------


def test_foreign_encodings(tmp_path: Path) -> None:
    rows = [f"{comma(x, 2)};{comma(z)}" for x, z in zip(X, MM, strict=True)]
    head = "Station_m;Höhenlage links_mm"
    said = {
        "chainage_column": "Station_m",
        "level_column": "Höhenlage links_mm",
        "separator": "semicolon",
        "decimal": ",",
    }
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):  # these say what they are
        path = file(tmp_path / f"{encoding}.csv", head, rows, encoding)
        np.testing.assert_allclose(sds(path, **said), truth(), rtol=0.03)
    path = file(tmp_path / "a.csv", head, rows, "cp1252")
    with pytest.raises(InputError, match=r"byte 0xf6.*'Station_m;Höhenlage links_mm'.*\"cp1252\""):
        record(path, **said)
    np.testing.assert_allclose(sds(path, encoding="cp1252", **said), truth(), rtol=0.03)
    path = file(tmp_path / "b.csv", head, rows, "utf-16-le")
    with pytest.raises(InputError, match=r"UTF-16 text without a byte order mark"):
        record(path, **said)
    remarks = [f"{x},{z:.4f},{'Brücke' if i % 999 == 700 else ''}" for i, (x, z) in
               enumerate(zip(X, MM, strict=True))]  # fmt: skip
    path = file(tmp_path / "c.csv", "chainage_m,level_mm,remark", remarks, "cp1252")
    np.testing.assert_allclose(sds(path), truth(), rtol=0.03)


def test_the_command_says_all_of_it_and_never_a_traceback(tmp_path: Path) -> None:
    path = file(tmp_path / "a.csv", "Höhe_mm;km", ["1,0;x"] * 20, "cp1252")
    shown = runner.invoke(app, ["profile", str(path)])
    assert shown.exit_code == 2
    assert "byte 0xf6" in shown.stderr
    assert "Traceback" not in shown.stderr


# --- ten further notations -------------------------------------------------------------------------


def two_columns(x: float, z: float) -> str:
    return f"{int(x // 1000)},{x % 1000:.2f},{z:.4f}"


def chains(x: float, z: float) -> str:
    total = x / 20.1168
    return f"{12 + int(total // 80)}m {total % 80:.4f}ch,{z:.4f}"


def thousands(x: float, z: float) -> str:
    return f'"{x + 12000:,.2f}",{z:.4f}'


def swiss(x: float, z: float) -> str:
    return f"{x + 12000:,.2f};{z:.4f}".replace(",", "'")


def german(x: float, z: float) -> str:
    text = f"{x + 12000:,.2f}".replace(",", "_").replace(".", ",").replace("_", ".")
    return f"{text};{comma(z)}"


def yards(x: float, z: float) -> str:
    return f"{4 + int(x // 1609.344)},{(x % 1609.344) / 0.9144:.4f},{z:.4f}"


FURTHER: dict[str, tuple[str, Callable[[float, float], str], dict[str, Any]]] = {
    "kilometres and metres in two columns": (
        "km,metres,level_mm",
        two_columns,
        {"chainage_column": "km", "offset_column": "metres", "chainage_unit": "km+m"},
    ),
    "miles and yards in two columns": (
        "miles,yd,level_mm",
        yards,
        {"chainage_column": "miles", "offset_column": "yd", "chainage_unit": "mi.yd"},
    ),
    "miles and chains in words": (
        "position,level_mm",
        chains,
        {"chainage_column": "position", "chainage_unit": "mi.ch"},
    ),
    "commas between thousands": ("chainage_m,level_mm", thousands, {"thousands": ","}),
    "apostrophes between thousands": (
        "chainage_m;level_mm",
        swiss,
        {"thousands": "'", "separator": "semicolon"},
    ),
    "points between thousands, decimal commas": (
        "chainage_m;level_mm",
        german,
        {"thousands": ".", "decimal": ",", "separator": "semicolon"},
    ),
    "a row of units below the heading": (
        "chainage_m;level_mm\r\n[m];[mm]",
        lambda x, z: f"{x};{z:.4f}",
        {"separator": "semicolon", "skip_after_heading": 1},
    ),
    "a typographic minus sign": (
        "chainage_m,level_mm",
        lambda x, z: f"{x},{z:.4f}".replace("-", "−"),
        {},
    ),
    "levels in inches, positive up, units in brackets": (
        "Chainage (ft)\tTop [in]",
        lambda x, z: f"{x / 0.3048:.4f}\t{-z / 25.4:.6f}",
        {
            "chainage_column": "Chainage (ft)",
            "level_column": "Top [in]",
            "separator": "tab",
            "positive": "up",
        },
    ),
    "travelled against the chainage": (
        "chainage_m,level_mm",
        lambda x, z: f"{30000 - x},{z:.4f}",
        {},
    ),
}


@pytest.mark.parametrize("name", FURTHER)
def test_further_notations(tmp_path: Path, name: str) -> None:
    head, row, said = FURTHER[name]
    path = file(tmp_path / "a.csv", head, [row(x, z) for x, z in zip(X, MM, strict=True)])
    right = truth()[::-1] if name.startswith("travelled") else truth()
    np.testing.assert_allclose(sds(path, **said), right, rtol=0.03)
    if {"thousands", "skip_after_heading", "chainage_unit"} & set(said):  # not said: refused
        left_out = {k: v for k, v in said.items() if k not in ("thousands", "skip_after_heading")}
        left_out.pop("chainage_unit", None)
        with pytest.raises(InputError, match=r"thousands = |skip_after_heading|chainage_unit"):
            record(path, **left_out)


def test_dated_runs_in_words_and_serials(tmp_path: Path) -> None:
    def dated(name: str, first: str, second: str) -> Path:
        rows = [f"{x},{z:.4f},{day}" for day, z_of in ((first, MM), (second, 1.1 * MM))
                for x, z in zip(X, z_of, strict=True)]  # fmt: skip
        return file(tmp_path / name, "chainage_m,level_mm,measured", rows)

    path = dated("dmy.csv", "05/03/2021", "11/09/2021")
    said = {"run_column": "measured"}
    runs = read_record(path, RecordFormat(dates="day_first", **said))
    assert [run.name for run in runs] == ["2021-03-05", "2021-09-11"]
    runs = read_record(path, RecordFormat(dates="month_first", **said))
    assert [run.name for run in runs] == ["2021-05-03", "2021-11-09"]
    with pytest.raises(
        InputError, match=r"2 faults.*\n.*'05/03/2021' is not ISO .*say which comes"
    ):
        read_record(path, RecordFormat(dates="iso", **said))
    path = dated("serial.csv", "44260", "44450.5")
    with pytest.raises(
        InputError, match=r"'44260' is a spreadsheet's serial .* would be 2021-03-05"
    ):
        read_record(path, RecordFormat(dates="day_first", **said))
    path = dated("odd.csv", "31.2.2021", "13.09.2021")
    with pytest.raises(InputError, match=r"'31.2.2021' is no date of the calendar"):
        read_record(path, RecordFormat(dates="day_first", **said))


def test_unpadded_metres_behind_the_point(tmp_path: Path) -> None:
    """km.m without padding: 12.9 is followed by 12.10."""
    x = np.arange(0.0, LENGTH)
    rows = [f"{12 + int(a // 1000)}.{int(a % 1000)},{z:.4f}" for a, z in
            zip(x, track(x) * 1e3, strict=True)]  # fmt: skip
    path = file(tmp_path / "a.csv", "pk,level_mm", rows)
    said = {"chainage_column": "pk"}
    with pytest.raises(InputError, match=r'kilometres and metres .*chainage_unit = "km\.m"'):
        record(path, chainage_unit="km", **said)
    found = sds(path, chainage_unit="km.m", **said)
    np.testing.assert_allclose(found[1:5], truth()[1:5], rtol=0.03)


def test_rows_at_equal_distances_without_a_chainage(tmp_path: Path) -> None:
    cells = [f"{z:.4f}" for z in MM]
    cells[1500:1504] = ["n/a"] * 4
    path = file(tmp_path / "a.csv", "level_mm", cells)
    with pytest.raises(InputError, match="no column 'chainage_m'"):
        record(path)
    said = {"spacing_m": STEP, "missing_values": ("n/a",)}
    found = record(path, ("missing", "gaps"), start_m=7000.0, **said)
    assert found.sections.chainage_from.tolist() == [7000 + 200 * i for i in range(6)]
    np.testing.assert_allclose(found.sections.sd, truth(), rtol=0.03)
    with pytest.raises(InputError, match="leave out chainage_unit"):
        record(path, chainage_unit="m", **said)


def test_faults_of_cells_and_of_the_track_are_in_one_refusal(tmp_path: Path) -> None:
    """Words where nothing was read, and a long kilometre behind them."""
    rows = [f"{x if x < 900 else x - 80},{z:.4f}" for x, z in zip(X, MM, strict=True)]
    rows[200] = f"{X[200]},bad"
    path = file(tmp_path / "a.csv", "chainage_m,level_mm", rows)
    with pytest.raises(InputError) as caught:
        record(path)
    text = str(caught.value)
    assert "2 faults" in text
    for said in ("'bad'", "as far as it can be read", "missing: 1 rows", "steps: 1 steps back"):
        assert said in text
    assert "repair = ['missing', 'steps', 'gaps']" in text
    np.testing.assert_allclose(
        sds(path, "missing", "steps", "gaps", missing_values=("bad",)), truth(), rtol=0.03
    )


# --- what was measured -----------------------------------------------------------------------------


def test_a_column_that_is_band_passed_is_not_filtered_again(tmp_path: Path) -> None:
    from mcsettle.railway.filters import band_passed

    d1 = Band(3.0, 25.0, "butterworth", 4)
    passed = band_passed(LEVEL, STEP, d1)
    path = file(tmp_path / "a.csv", "chainage_m,level_mm",
                [f"{x},{z * 1e3:.5f}" for x, z in zip(X, passed, strict=True)])  # fmt: skip
    right = passed.reshape(6, 800).std(axis=1)
    told = record(path, band=Band(3.0, 25.0, "butterworth", 4, passed=True)).sections.sd
    np.testing.assert_allclose(told, right, rtol=1e-4)
    twice = record(path, band=d1).sections.sd
    assert np.all(twice < 0.99 * right)


@pytest.mark.parametrize("chord", [10.0, 12.0])
def test_versines_are_refused_or_converted_with_what_is_lost(tmp_path: Path, chord: float) -> None:
    half = 0.5 * chord
    versine = LEVEL - 0.5 * (track(X - half) + track(X + half))
    rows = [f"{x},{z * 1e3:.5f}" for x, z in zip(X, versine, strict=True)]
    path = file(tmp_path / "a.csv", "chainage_m,versine_mm", rows)
    said = {"level_column": "versine_mm"}
    with pytest.raises(InputError, match=r"offsets from a chord by its name.*versine_chord_m"):
        record(path, **said)
    found = record(path, versine_chord_m=chord, **said)
    blind = f"{chord / 2:.3g}"
    assert any(blind in remark and "lost on an FRA" in remark for remark in found.remarks)
    ratio = found.sections.sd / truth()
    assert np.all(np.abs(ratio[1:5] - 0.96) < 0.05), ratio
    assert np.all(np.abs(ratio - 1.0) < 0.1), ratio


# --- sections --------------------------------------------------------------------------------------


def test_an_uneven_last_section_is_kept_and_said(tmp_path: Path) -> None:
    def cut_at(length: float) -> Record:
        n = int(length / STEP)
        rows = [f"{x + 5000},{z:.4f}" for x, z in zip(X[:n], MM[:n], strict=True)]
        return record(file(tmp_path / f"{length}.csv", "chainage_m,level_mm", rows))

    found = cut_at(1150.0)
    assert found.sections.chainage_from.tolist() == [5000, 5200, 5400, 5600, 5800, 6000]
    assert found.sections.chainage_to[-2:].tolist() == pytest.approx([6000, 6150])
    piece = found.sections.passed[4000:]
    assert found.sections.sd[-1] == pytest.approx(np.std(piece), rel=1e-12)
    assert any("150 m long (6000 to 6150 m)" in remark for remark in found.remarks)
    found = cut_at(1050.0)
    assert len(found.sections.sd) == 5
    assert found.sections.left_over == pytest.approx(50.0)
    assert any(remark.startswith("50 m at the end") for remark in found.remarks)
    assert cut_at(1200.0).remarks == ()
