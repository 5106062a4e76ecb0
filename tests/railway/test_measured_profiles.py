"""Studies on measured records: what was put in comes out, ensembles, refusals, the command."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy
from typer.testing import CliRunner

from mcsettle.analysis.profile import profile_report, quality_class
from mcsettle.cli.app import app
from mcsettle.errors import InputError
from mcsettle.railway.filters import Band
from mcsettle.railway.irregularity import sample_profiles, standard_deviation, to_space, wavenumbers
from mcsettle.railway.measured_profiles import ensemble
from mcsettle.railway.record import Run
from mcsettle.railway.record_sections import cut
from mcsettle.railway.spectra import FRA_ROUGHNESS, spectrum
from mcsettle.study.study import Study, load_study, resolved_toml

LENGTH, FOOT = 4000.0, 0.3048
MODES = wavenumbers(200.0)
runner = CliRunner()


@pytest.fixture(scope="module")
def track() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A 4 km track of waves from 1 to 190 m: x [N] m, level [N] m, SD of each 200 m in 3–35 m [20]."""
    k = wavenumbers(LENGTH, 1.0, 190.0)
    amplitudes = sample_profiles(spectrum("fra", 6), k, LENGTH, 5, [0])
    x = np.arange(0.0, LENGTH, FOOT)
    inside = (k > 2 * np.pi / 35.0 - 1e-9) & (k < 2 * np.pi / 3.0 + 1e-9)
    fine = np.arange(0.0, 4000.0, 0.25)
    band = to_space(amplitudes[:, inside], k[inside], fine)[0]
    return x, to_space(amplitudes, k, x)[0], band.reshape(20, 800).std(axis=1)


def record_csv(path: Path, x: np.ndarray, level: np.ndarray) -> Path:
    """Miles of feet and inches, positive up, semicolons; noise, gap, repeated row and spike."""
    level = level + np.random.default_rng(1).normal(0.0, 0.05e-3, len(x))
    level[5000] += 0.025
    keep = np.ones(len(x), bool)
    keep[3000:3010] = False
    x, level = x[keep], level[keep]
    x, level = np.insert(x, 100, x[100]), np.insert(level, 100, level[100])
    rows = [f"{a:.4f};{b:.5f}" for a, b in zip(x / FOOT, -level / 0.0254, strict=True)]
    path.write_text("\n".join(["loc;top", *rows]) + "\n", encoding="utf-8")
    return path


LAYOUT: dict[str, Any] = {
    "chainage_column": "loc",
    "level_column": "top",
    "chainage_unit": "ft",
    "level_unit": "in",
    "positive": "up",
    "separator": "semicolon",
    "repair": ["gaps", "repeated", "spikes"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, track) -> Path:
    folder = tmp_path_factory.mktemp("record")
    record_csv(folder / "record.csv", *track[:2])
    return folder


def study(folder: Path, record: dict[str, Any] | None = None, **profile: Any) -> Study:
    data = toy.study().model_dump(by_alias=True, exclude_none=True, exclude={"profile"})
    own = {"file": "record.csv", "record": LAYOUT | (record or {}), **profile}
    return Study.from_mapping(
        {**data, "profile": own, "limit": {"sd_limit_mm": 9.0}}, folder=folder
    )


def test_sd_and_spectrum_of_a_synthesised_record_come_back(folder: Path, track) -> None:
    """Each section within 1 %; those at an end, with the gap (5th) and the spike (8th) within 3 %."""
    found = study(folder, {"ensemble": "sections"}).record()
    assert found is not None
    ratio = found.sections.sd / track[2]
    rough = [0, 4, 7, 19]
    assert np.max(np.abs(np.delete(ratio, rough) - 1.0)) < 0.01, ratio
    assert np.max(np.abs(ratio - 1.0)) < 0.03, ratio
    report = profile_report(found, 200.0, MODES, Band())
    fit = {f.shape: f for f in report.fits}["fra"]
    assert abs(fit.roughness - FRA_ROUGHNESS[5]) < 2.0 * fit.standard_error
    assert fit.nearest == "class 6"
    assert {f.kind for f in report.findings} == {"repeated", "gaps", "spikes"}
    assert report.filter_effect == pytest.approx(1.0, abs=1e-6)


def test_blending_the_ends_does_not_bias_the_variance() -> None:
    """Before scaling: mean square of the blend over that of the section, over many sections."""
    k = wavenumbers(8000.0, 1.0, 190.0)
    amplitudes = sample_profiles(spectrum("fra", 6), k, 8000.0, 7, [0])
    x = np.arange(0.0, 8000.0, 0.5)
    parts = cut(Run("", x, to_space(amplitudes, k, x)[0]), 200.0, MODES, Band())
    squares = 1.0 / parts.scaling**2
    error = squares.std(ddof=1) / np.sqrt(len(squares))
    assert abs(squares.mean() - 1.0) < 3.0 * error + 5e-3  # the band's own edges leak a little
    np.testing.assert_allclose(standard_deviation(parts.amplitudes), parts.sd, rtol=1e-12)


def test_beyond_the_blend_a_section_is_the_record() -> None:
    """Place, sign and height: from 40 to 195 m the waves of the window draw the filtered record."""
    k = wavenumbers(1200.0, 3.2, 33.0)
    amplitudes = sample_profiles(spectrum("fra", 6), k, 1200.0, 3, [0])
    x = np.arange(0.0, 1200.0, 0.25)
    level = to_space(amplitudes, k, x)[0]
    parts = cut(Run("", x, level), 200.0, MODES, Band())
    inner = np.arange(40.0, 195.0, 0.25)
    for row in (1, 2, 3):
        drawn = to_space(parts.amplitudes[row : row + 1], MODES, inner)[0] / parts.scaling[row]
        own = np.interp(200.0 * row + inner, x, level)
        # Waves that no window repeats, next to the band's edges, are what is missing.
        assert np.std(drawn - own) < 0.08 * np.std(own)
        assert np.corrcoef(drawn, own)[0, 1] > 0.996


def test_ensembles(folder: Path) -> None:
    record = study(folder).record()
    assert record is not None
    parts = record.sections
    itself = ensemble(parts, "section", 2, 0.0, 1, range(3))
    np.testing.assert_array_equal(itself, np.repeat(parts.amplitudes[1:2], 3, axis=0))
    phases = ensemble(parts, "phases", 2, 0.0, 1, range(3))
    np.testing.assert_allclose(np.abs(phases), np.abs(itself), rtol=1e-12)
    assert np.min(np.abs(np.angle(phases[0] / phases[1]))) > 1e-6
    line = ensemble(parts, "sections", 1, 0.0, 1, range(20))
    np.testing.assert_array_equal(line, parts.amplitudes)
    noisy = ensemble(parts, "sections", 1, 0.2e-3, 1, range(40))
    errors = standard_deviation(noisy - np.tile(parts.amplitudes, (2, 1)))
    assert errors.mean() == pytest.approx(0.2e-3, rel=4.0 / np.sqrt(2 * 61 * 40))
    for kind, noise in (("phases", 0.0), ("section", 1e-4)):  # addressed: alone as in a batch
        batch = ensemble(parts, kind, 1, noise, 9, range(5))
        np.testing.assert_array_equal(ensemble(parts, kind, 1, noise, 9, [3])[0], batch[3])
    with pytest.raises(InputError, match=r"20 sections, and realisation 20 .*at most 20"):
        ensemble(parts, "sections", 1, 0.0, 1, range(21))
    with pytest.raises(InputError, match="section 21 is asked for; the record has 1 to 20"):
        ensemble(parts, "phases", 21, 0.0, 1, range(2))


def test_profiles_of_a_study(folder: Path) -> None:
    plain = study(folder, {"ensemble": "phases", "section": 3})
    found = plain.record()
    assert found is not None
    own = standard_deviation(plain.initial_profiles().sample(range(4)))
    np.testing.assert_allclose(own, found.sections.sd[2], rtol=1e-12)
    scaled = study(folder, {"ensemble": "phases"}, sd_mm=1.03)
    own = standard_deviation(scaled.initial_profiles().sample(range(4)))
    np.testing.assert_allclose(own, 1.03e-3, rtol=1e-12)


def test_a_run_on_a_record_ends_at_the_limit_and_keeps_the_digest(
    folder: Path, tmp_path: Path, fresh_cache: Path
) -> None:
    from mcsettle import run_study
    from mcsettle.storage.store import read
    from mcsettle.summary.results import read_results

    place = tmp_path / "in"
    place.mkdir()
    (place / "record.csv").write_bytes((folder / "record.csv").read_bytes())
    own = study(place, {"ensemble": "sections"}, sd_mm=1.03).with_run(realisations=6)
    data = own.model_dump(by_alias=True, exclude_none=True)
    own = Study.from_mapping(
        data | {"limit": {"sd_limit_mm": 1.5, "horizon_years": 2.0}}, folder=place
    )
    finished = run_study(own, tmp_path / "out")
    before = own.initial_profiles().sample(range(1))
    table = read(finished.folder, "realisations").to_pandas()
    assert set(table["status"]) == {"reached"}
    np.testing.assert_allclose(table["sd_initial_mm"], 1.03, rtol=1e-6)
    days = table[table["scenario"] == "v201"]["tamping_interval_days"]
    assert days.nunique() == 6
    # The results keep a copy of the record: its tracks can be drawn again without the study's folder.
    (place / "record.csv").unlink()
    again = read_results(finished.folder).study
    assert again.digest == own.digest
    np.testing.assert_array_equal(again.initial_profiles().sample(range(1)), before)


def test_the_digest_is_that_of_the_content(folder: Path, tmp_path: Path, track) -> None:
    first = study(folder)
    record_csv(tmp_path / "record.csv", *track[:2])
    assert study(tmp_path).digest == first.digest
    record_csv(tmp_path / "record.csv", track[0], track[1] * 1.1)
    other = study(tmp_path)
    assert other.digest != first.digest
    pinned = {"sha256": first.profile.record.sha256}  # type: ignore[union-attr]
    with pytest.raises(InputError, match="not the file that the study was made with"):
        study(tmp_path, pinned)


def test_files_stay_in_the_studys_folder(folder: Path, tmp_path: Path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "record.csv").write_bytes((folder / "record.csv").read_bytes())
    (inner / "link.csv").symlink_to(tmp_path / "record.csv")
    for name in ("../record.csv", str(tmp_path / "record.csv"), "link.csv", "a/../../record.csv"):
        with pytest.raises(InputError, match="leads out of the study's folder"):
            study(inner, file=name)
    data = study(folder).model_dump(by_alias=True, exclude_none=True)
    data["profile"] = {"file": "../record.csv", "record": LAYOUT}
    assert Study.from_mapping(data | {"files_outside": True}, folder=inner).record() is not None
    with pytest.raises(InputError, match=r"profile.file: .*does not exist"):
        study(inner, file="none.csv")
    with pytest.raises(InputError, match=r"profile.file: received 'a\\x00b'"):
        study(inner, file="a\0b")


@pytest.mark.parametrize(
    ("profile", "said"),
    [
        ({"file": None, "record": {}}, "profile.record: has no meaning without profile.file"),
        ({"spectrum": "german_low"}, "profile.spectrum: has no meaning with profile.file"),
        ({"record": {"filter": "en13848_d1"}}, "D1 is shortest_m = 3, longest_m = 25"),
        ({"record": {"run": "a"}}, "say which column does: run_column"),
        ({"record": {"chainage_column": "x"}}, "unit of the chainage is not told"),
    ],
)
def test_what_does_not_fit_together_is_refused(
    folder: Path, profile: dict[str, Any], said: str
) -> None:
    data = toy.study().model_dump(by_alias=True, exclude_none=True, exclude={"profile"})
    own = {"file": "record.csv", **profile}
    own = {key: value for key, value in own.items() if value is not None}
    with pytest.raises(InputError, match=said):
        _ = Study.from_mapping({**data, "profile": own}, folder=folder).warnings


def test_coarse_short_and_flat_records_are_refused() -> None:
    x = np.arange(0.0, 600.0, 0.25)
    wave = 1e-3 * np.sin(x)
    with pytest.raises(InputError, match="check chainage_unit"):
        cut(Run("", x * 10.0, wave), 200.0, MODES, Band())
    with pytest.raises(InputError, match="150 m long; a section"):
        cut(Run("", x[:601], wave[:601]), 200.0, MODES, Band())
    for factor in (1e-4, 1e3):
        with pytest.raises(InputError, match="check level_unit"):
            cut(Run("", x, wave * factor), 200.0, MODES, Band())


def test_the_command(folder: Path, tmp_path: Path) -> None:
    options = ["--separator", "semicolon", "--chainage-column", "loc", "--level-column", "top"]
    path = str(folder / "record.csv")
    refused = runner.invoke(app, ["profile", path, *options])
    assert refused.exit_code == 2
    assert "the unit of the chainage is not told" in refused.stderr
    options += ["--chainage-unit", "ft", "--level-unit", "in", "--positive", "up"]
    refused = runner.invoke(app, ["profile", path, *options])
    assert refused.exit_code == 2
    assert "repair = ['repeated', 'gaps']" in refused.stderr
    options += ["--repair", "gaps,repeated,spikes"]
    out = tmp_path / "look"
    shown = runner.invoke(app, ["profile", path, *options, "--speed-kmh", "200", "--out", str(out)])
    assert shown.exit_code == 0, shown.stderr
    assert "SD of 20 sections of 200 m" in shown.stdout
    assert "finding: spikes: 1 spikes" in shown.stdout
    assert sorted(p.name for p in out.iterdir() if p.is_file()) == [
        "profile.json", "profile.png", "profile.svg",
    ]  # fmt: skip
    told = runner.invoke(app, ["profile", path, *options, "--filter", "en13848_d1", "--json"])
    data = json.loads(told.stdout)
    assert len(data["sections"]) == 20
    assert data["sections"][0]["sd_mm"] == pytest.approx(data["sections"][0]["sd_d1_mm"])
    assert 0.9 < data["filter"]["sd_over_ideal"] < 1.0
    own = folder / "study.toml"
    own.write_text(resolved_toml(study(folder)), encoding="utf-8")
    assert load_study(own).profile.file == "record.csv"
    told = runner.invoke(app, ["profile", str(own)])
    assert told.exit_code == 0, told.stderr
    refused = runner.invoke(app, ["profile", str(own), "--window", "100"])
    assert refused.exit_code == 2
    assert refused.stderr.endswith("leave out --window\n")


def test_quality_classes() -> None:
    assert [quality_class(sd * 1e-3, 200.0) for sd in (0.5, 0.7, 1.0, 1.5, 2.0)] == list("ABCDE")
    assert quality_class(1.0e-3, 60.0) == "A"
    assert quality_class(1.0e-3, 280.0) == "D"
