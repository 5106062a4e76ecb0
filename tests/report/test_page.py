"""The report: right numbers, safe and the same bytes whatever the run; every input in the register."""

import contextlib
import re
import tomllib
from html.parser import HTMLParser
from pathlib import Path

import made_run
import numpy as np
import pytest
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.economics import elasticity, marginal_cost
from mcsettle.estimate.estimate import Estimate
from mcsettle.report.build import read_report
from mcsettle.report.charging import KM_PER_MILE, marginal_train, price_units
from mcsettle.report.material import read_material
from mcsettle.report.notebook import plot
from mcsettle.report.page import Page
from mcsettle.report.quality import _with_limits
from mcsettle.report.register import entries
from mcsettle.report.render import html, markdown
from mcsettle.study.study import Study, load_study, resolved_toml, study_from_text
from mcsettle.study.written import study_data
from mcsettle.summary.results import study_of

DAYS = np.linspace(500.0, 900.0, 41)
SPEED = {"v201": DAYS, "v225": 0.8 * DAYS}
VOID = {"meta", "link", "br", "wbr"}
HOSTILE = "<script>alert(1)</script> & \"quoted' $\\frac{ \x01 </svg><img src=x onerror=alert(2)>"


class Tags(HTMLParser):
    """Tags in balance, ids, and everything that could load or run something."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.images: list[str] = []
        self.links: list[str] = []
        self.handlers: list[str] = []
        self.seen: set[str] = set()
        self.text: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.seen.add(tag)
        given = dict(attrs)
        self.ids += [v for k, v in attrs if k == "id"]
        self.handlers += [k for k in given if k.startswith("on")]
        self.links += [v or "" for k, v in attrs if k in ("href", "src", "xlink:href")]
        if given.get("role") == "img":
            self.images.append(given.get("aria-label") or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_data(self, data):
        self.text.append(data)


def parsed(text: str) -> Tags:
    tags = Tags()
    tags.feed(text)
    tags.close()
    return tags


def checked(text: str) -> Tags:
    """A page that is whole, loads nothing and runs nothing."""
    tags = parsed(text)
    assert tags.open == []
    assert len(tags.ids) == len(set(tags.ids))
    assert not tags.handlers
    assert not tags.seen & {"script", "iframe", "object", "embed", "form"}
    assert all(link.startswith(("#", "data:")) for link in tags.links)
    assert all(len(alt) > 20 for alt in tags.images)
    assert "default-src 'none'" in text
    return tags


def page_of(folder: Path, **options) -> str:
    return html(read_report(folder, **options))


@pytest.fixture(scope="module")
def speed_run(tmp_path_factory) -> Path:
    reference = [
        {"metric": "tamping_interval_days", "scenario": "v201", "value": 697.0, "unit": "d",
         "source": "Table 3"},
        {"metric": "elasticity", "scenario": "v225", "value": -1.55, "unit": "1",
         "source": "Table 12", "note": "One track there, many here."},
        {"metric": "sd_growth_1y_mm", "scenario": "v201", "value": 0.244, "unit": "mm",
         "source": "text beside a figure"},
    ]  # fmt: skip
    made = made_run.study(reference=reference)
    return made_run.write(tmp_path_factory.mktemp("speed") / "run", made, SPEED)


@pytest.fixture(scope="module")
def speed_report(speed_run: Path) -> Page:
    return read_report(speed_run)


@pytest.fixture(scope="module")
def speed_page(speed_report: Page) -> str:
    return html(speed_report)


def test_page_is_whole_and_answers_first(speed_page: str) -> None:
    text = speed_page
    tags = checked(text)
    assert tags.images
    first = text[: text.index("<nav")]
    assert "What does a faster passenger train cost in tamping?" in first
    # Currency, unit, price with its interval, spread of the sections, worth of the number.
    for said in ("GBP", "per train-km", "line mean (95 %)", "sections, P5 to P95", "Supported:"):
        assert said in first
    assert "Run the set of forms" in first  # one form only
    assert first.count('<figure class="bars') == 1
    for unit in ("per 1000 gross tonne-km", "per train-km", "per vehicle-km"):
        assert unit in text[text.index('id="charges"') :]
    last = text[text.index('id="provenance"') :]
    for part in (
        "mcsettle run study.toml",
        "--realisations 41",
        "study digest",
        "sd_limit_mm = 1.5",
    ):
        assert part in last
    assert text.index('id="register"') < text.index('id="provenance"')


def test_same_run_elsewhere_gives_the_same_bytes(
    speed_run: Path, speed_page: str, tmp_path: Path
) -> None:
    made = read_material(speed_run).study
    other = made_run.write(tmp_path / "elsewhere", made, SPEED)
    assert speed_page == page_of(other)


def test_answer_is_the_closed_form_in_every_unit(speed_run: Path) -> None:
    # Every interval is 0.8 of the baseline's: one elasticity, and the cost at the median is known.
    material = read_material(speed_run)
    study = material.study
    change = study.change("v225")
    gamma = elasticity(1.0, 0.8, 201.0, 225.0)
    median = float(np.median(marginal_cost(gamma, DAYS / 365.0, 5625.0, 0.035, change.divisor)))
    factors = {unit.label: unit.factor for unit in price_units(study, "v225")}
    train = marginal_train(study, "v225")
    assert (train.mass, train.cars, train.base_speed, train.speed) == (748.0, 11, 201.0, 225.0)
    expected = {
        "km/h per 1000 train-km": median,
        "train-km": median * 24.0 / 1000.0,
        "vehicle-km": median * 24.0 / 1000.0 / 11.0,
        "1000 gross tonne-km": median * 24.0 / 748.0,
    }
    assert set(factors) == set(expected)
    cost = material.row("v225", "marginal_cost").at(0.5).value
    for unit, value in expected.items():
        assert cost * factors[unit] == pytest.approx(value, rel=1e-12)


def test_tonnage_is_charged_by_the_mass_of_the_added_train(tmp_path: Path) -> None:
    made = made_run.tonnage_study()
    folder = made_run.write(tmp_path / "run", made, {"A": DAYS, "C": 0.95 * DAYS})
    train = marginal_train(made, "C")
    assert (train.name, train.mass, train.speed) == ("freight", pytest.approx(4000.0), 97.0)
    factors = {unit.label: unit.factor for unit in price_units(made, "C")}
    assert factors == {
        "1000 gross tonne-km": 1.0,
        "train-km": pytest.approx(4.0),
        "vehicle-km": pytest.approx(0.1),
    }
    miles = {unit.label: unit.factor for unit in price_units(made, "C", miles=True)}
    assert miles["train-mile"] == pytest.approx(4.0 * KM_PER_MILE)
    assert "per train-mile" in page_of(folder, miles=True)
    assert "One more freight train a day (4000 t, 97 km/h) costs about" in page_of(folder)


def test_no_single_train_no_charge_per_train() -> None:
    base = [{"train": "passenger", "speed_kmh": 200.0, "per_day": 72}]
    two = [{"train": "passenger", "speed_kmh": 200.0, "per_day": 73},
           {"train": "freight", "speed_kmh": 97.0, "per_day": 1}]  # fmt: skip
    less = [{"train": "passenger", "speed_kmh": 200.0, "per_day": 71}]
    scenarios = [{"name": n, "timetable": t} for n, t in (("A", base), ("C", two), ("D", less))]
    made = made_run.tonnage_study(scenarios=scenarios)
    assert marginal_train(made, "A") is None
    assert marginal_train(made, "C") is None
    assert marginal_train(made, "D") is None


def test_hostile_words_stay_words(tmp_path: Path) -> None:
    given = tomllib.loads(resolved_toml(made_run.study()))
    for scenario in given["scenarios"]:
        scenario["title"] = HOSTILE
    made = made_run.study(
        title=HOSTILE,
        scenarios=given["scenarios"],
        variants=[{"name": "base", "title": HOSTILE}],
        sources={"profile": HOSTILE},
        reference=[{"metric": "elasticity", "scenario": "v225", "value": 1.0, "unit": HOSTILE,
                    "source": HOSTILE, "note": HOSTILE}],
    )  # fmt: skip
    folder = made_run.write(tmp_path / "run", made, SPEED)
    page = read_report(folder)
    text = html(page)
    tags = checked(text)
    assert "alert(1)" in "".join(tags.text)  # it is shown, as text
    assert "img" not in tags.seen
    assert "\x01" not in text
    assert "<script" not in markdown(page)


def test_everything_censored(tmp_path: Path) -> None:
    made = made_run.study(reference=[{"metric": "tamping_interval_days", "scenario": "v201",
                                      "value": 697.0, "unit": "d", "source": "Table 3"}])  # fmt: skip
    never = np.full(20, np.nan)
    folder = made_run.write(tmp_path / "run", made, {"v201": never, "v225": never})
    text = page_of(folder)
    checked(text)
    first = text[: text.index("<nav")]
    assert "No section reached its limit within 50 years" in first
    assert "no price." in first
    assert not re.search(r"\b(nan|inf)\b", " ".join(parsed(text).text), re.IGNORECASE)


def test_later_tables_say_once_what_is_not_reached(tmp_path: Path) -> None:
    """No rows of blanks, no rounding noise for an error, scenarios of one fate in one row."""
    published = {"metric": "tamping_interval_days", "scenario": "v201", "value": 697.0, "unit": "d",
                 "source": "Table 3"}  # fmt: skip
    variants = [{"name": "fitted"}, {"name": "literal", "settlement_factor": 1.0}]
    made = made_run.study(reference=[published], variants=variants)
    never = np.full(41, np.nan)
    page = read_report(made_run.write(tmp_path / "run", made, {"v201": never, "v225": never}))
    text = markdown(page)
    assert "| fitted | v201, v225 | 41 | 0 | 41 | 0 |" in text
    assert "known of most sections: fitted, literal (v201, tamping interval)." in text
    assert "| literal | not reached" not in text


def test_an_error_that_is_rounding_noise_is_none() -> None:
    noise = Estimate(1.37, None, 1.37, 1.8e-14, 64, 0, "%")
    assert _with_limits(noise, "not reached") == ("1.37", "open", "1.37", "0", "0.0")
    sound = Estimate(1130.4, 940.2, None, 121.0, 64, 0, "d")
    assert _with_limits(sound, "not reached") == ("1130", "940", "open", "120", "10.7")
    gone = Estimate(None, 0.61, None, None, 64, 34, "mm")
    assert _with_limits(gone, "tamped before")[:3] == ("tamped before", "0.610", "open")


def test_one_censored_scenario_states_no_cost(tmp_path: Path) -> None:
    never = np.full(41, np.nan)
    folder = made_run.write(tmp_path / "run", made_run.study(), {"v201": DAYS, "v225": never})
    text = page_of(folder)
    checked(text)
    assert "no price. Only 0 of 41 pairs of sections reach the limit within 50 years" in text
    assert "41 of 82 realisations had not reached" in text


def test_a_minority_of_tracks_states_no_cost(tmp_path: Path) -> None:
    """Few of the tracks reach the limit in both scenarios: those that do are not like the others."""
    later = np.where(np.arange(41) < 5, 0.8 * DAYS, np.nan)
    folder = made_run.write(tmp_path / "run", made_run.study(), {"v201": DAYS, "v225": later})
    page = page_of(folder)
    first = page[: page.index("<nav")]
    assert "no price. Only 5 of 41 pairs of sections reach the limit within 50 years" in first
    assert "the line&#39;s mean is at most" in first
    assert "Supported: no" in first
    assert "Charge table" not in page
    most = np.where(np.arange(41) < 36, 0.8 * DAYS, np.nan)
    folder = made_run.write(tmp_path / "most", made_run.study(), {"v201": DAYS, "v225": most})
    assert "no price" not in page_of(folder)


def test_one_realisation_one_scenario_failed_rows(tmp_path: Path) -> None:
    one = {"v201": [697.0], "v225": [568.0]}
    text = page_of(made_run.write(tmp_path / "one", made_run.study(), one))
    checked(text)
    assert "One section only" in text
    scenarios = made_run.study().scenarios[:1]
    alone = made_run.study(economics=None, scenarios=[s.model_dump(exclude_none=True) for s in
                                                      scenarios])  # fmt: skip
    text = page_of(made_run.write(tmp_path / "alone", alone, {"v201": DAYS}))
    checked(text)
    assert "How long until the track must be tamped" in text
    assert "There is no marginal cost" in text or "there is no marginal cost" in text
    failed = made_run.write(tmp_path / "failed", made_run.study(), SPEED, failed=(3, 4))
    text = page_of(failed)
    checked(text)
    assert "4 of 82 realisations failed" in text
    assert "the profile overflowed" in text
    every = made_run.write(tmp_path / "every", made_run.study(), one, failed=(0,))
    checked(page_of(every))


def test_published_values_stand_beside_ours(speed_report: Page) -> None:
    page = speed_report
    part = next(s for s in page.sections if s.key == "published")
    text = markdown(page, ("published",))
    tables = [b.caption for b in part.blocks if type(b).__name__ == "Table"]
    assert tables[:3] == ["Table 3", "Table 12", "text beside a figure"]
    assert "P49" in text  # 20 of 41 intervals lie below 697
    assert "One track there, many here." in text
    assert "Fig. 12" in text
    assert "published 697 days" in text


def test_without_published_values_there_is_no_such_part(tmp_path: Path) -> None:
    page = read_report(made_run.write(tmp_path / "run", made_run.study(), SPEED))
    assert "published" not in [s.key for s in page.sections]
    assert not any("of the paper" in p.caption for p in page.pictures)


def test_register_holds_every_input_and_who_set_it() -> None:
    uncertain = [{"input": "trains.passenger.axle_load_t", "distribution": "normal", "mean": 17.0,
                  "sd": 0.8, "source": "weighed"}]  # fmt: skip
    sources = {"profile": "measured", "profile.sd_mm": "paper, linespeed case study"}
    made = made_run.study(uncertain=uncertain, sources=sources, run={"parameter_sets": 2})
    found = {e.path: e for e in entries(made)}
    from mcsettle.study.key_paths import number_paths

    data = {k: v for k, v in study_data(made).items() if k in
            ("track", "profile", "settlement", "limit", "economics", "trains", "scenarios")}  # fmt: skip
    assert set(number_paths(data)) - set(found) <= {f"run.history_days.{i}" for i in range(1, 100)}
    by = {path: e.set_by for path, e in found.items()}
    assert by["track.layers.ballast.youngs_modulus_pa"] == "paper"
    assert found["track.layers.ballast.youngs_modulus_pa"].source == "Table 2"
    assert by["track.layers.ballast.k0"] == "default"
    assert by["trains.passenger.car_length_m"] == "default"
    assert by["trains.passenger.body_mass_kg"] == "paper"
    assert by["settlement.settlement_factor"] == "study"  # 19.433 is not the default
    assert by["economics.discount_rate"] == "paper"
    assert by["profile.sd_mm"] == "paper"
    assert (by["profile.window_m"], found["profile.window_m"].source) == ("study", "measured")
    assert by["seed"] == "study"  # equal to the default, and stated
    load = found["trains.passenger.axle_load_t"]
    assert (load.set_by, load.source, load.unit) == ("study", "weighed", "t")
    assert "normal: mean 17" in load.distribution


def origins_of(made: Study) -> dict[str, str]:
    return {entry.path: entry.set_by for entry in entries(made)}


def test_what_the_author_wrote_is_the_study_s_in_its_results_too(tmp_path: Path) -> None:
    """A value that equals the default, in a file where every default is written out."""
    train = {"vehicle": "passenger", "cars": 11, "axle_load_t": 17.0}
    made = made_run.study(trains={"passenger": train}, limit={"horizon_years": 50.0})
    by = origins_of(made)
    assert {by["trains.passenger.axle_load_t"], by["limit.horizon_years"]} == {"study"}
    assert (by["trains.passenger.body_mass_kg"], by["profile.spectrum"]) == ("paper", "default")
    assert by["economics.mgt_per_day"] == "study"  # it follows from the timetable
    folder = made_run.write(tmp_path / "run", made, SPEED)
    kept = study_of(folder)
    assert kept == made
    assert origins_of(kept) == by
    again = load_study(folder / "study.toml")  # as another run of it reads it
    assert (again.digest, origins_of(again)) == (made.digest, by)
    more = again.with_run(realisations=7, seed=5)
    changed = origins_of(more).items() - by.items()
    assert changed == {("run.realisations", "run"), ("seed", "run")}
    text = resolved_toml(made)  # as a version without the record kept it
    cut = re.sub(r"stated = \[.*?\]\n", "", text, count=1, flags=re.DOTALL)
    assert cut != text
    by = origins_of(study_from_text(cut.encode(), "study.toml"))
    assert (
        by["trains.passenger.axle_load_t"]
        == by["trains.passenger.body_mass_kg"]
        == "study or paper"
    )
    assert by["profile.spectrum"] == "study or default"
    assert by["settlement.settlement_factor"] == "study"


def test_values_of_vehicles_are_not_the_paper_s_unless_they_are() -> None:
    trains = {
        "fast": {"vehicle": "velaro", "cars": 8, "axle_load_t": 15.5},
        "mixed": {"library": "push_pull"},
        "own": {"consist": [{"vehicle": "mine", "count": 2}, {"vehicle": "freight", "count": 1}]},
        "passenger": {"vehicle": "passenger", "cars": 11},
    }
    made = made_run.study(
        trains=trains, vehicles={"mine": {"like": "passenger", "axle_load_t": 16.0}}
    )
    found = {entry.path: entry for entry in entries(made)}
    mass = {path: e.set_by for path, e in found.items() if path.endswith(".body_mass_kg")}
    assert mass == {
        "trains.fast.body_mass_kg": "library",
        "trains.mixed.consist.1.body_mass_kg": "library",
        "trains.mixed.consist.2.body_mass_kg": "library",
        "trains.mixed.consist.3.body_mass_kg": "library",
        "trains.own.consist.1.body_mass_kg": "study",
        "trains.own.consist.2.body_mass_kg": "paper",
        "trains.passenger.body_mass_kg": "paper",
    }
    assert "Velaro" in found["trains.fast.body_mass_kg"].source
    assert found["trains.fast.axle_load_t"].set_by == "study"
    assert found["trains.own.consist.1.body_mass_kg"].source == "vehicles.mine"
    assert found["trains.mixed.consist.1.count"].set_by == "library"


def test_changed_preset_is_the_study_s() -> None:
    made = made_run.study(
        track={"model": "section", "layers": {"ballast": {"youngs_modulus_pa": 2e8}}}
    )
    found = {e.path: e for e in entries(made)}
    assert found["track.layers.ballast.youngs_modulus_pa"].set_by == "study"


def test_sources_of_inputs_that_are_not_there_are_refused() -> None:
    from mcsettle.errors import InputError

    with pytest.raises(InputError, match=r"sources.*profile.sd_m"):
        made_run.study(sources={"profile.sd_m": "somewhere"})


def test_sources_notes_and_price_year_change_no_digest() -> None:
    plain = made_run.study()
    more = made_run.study(sources={"profile": "x"}, economics={"price_base_year": 2021})
    assert plain.digest == more.digest
    assert made_run.study(economics={"discount_rate": 0.03}).digest != plain.digest


def test_price_base_year_is_stated(tmp_path: Path) -> None:
    made = made_run.study(economics={"price_base_year": 2021})
    assert "prices of 2021" in page_of(made_run.write(tmp_path / "run", made, SPEED))


def test_markdown_has_every_table(speed_report: Page) -> None:
    page = speed_report
    text = markdown(page)
    for section in page.sections:
        for block in section.blocks:
            if type(block).__name__ == "Table" and block.rows:
                assert f"**{block.caption}".replace("_", "\\_") in text
    widths = {line.count(" | ") for line in text.splitlines() if line.startswith("| unit | P50 |")}
    assert widths == {3}


# --- the command ----------------------------------------------------------------------------------


def test_a_report_replaces_its_own_and_nothing_else(speed_run: Path, tmp_path: Path) -> None:
    """Refused before anything is computed; a README of the user's stays as it is."""
    page, text = tmp_path / "a.html", tmp_path / "README.md"
    text.write_text("# precious\n", encoding="utf-8")
    command = ("report", speed_run, "--out", page, "--markdown", text)
    done = invoke(*command)
    assert done.exit_code == 2
    assert "README.md' is there already and is not written by mcsettle" in done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["README.md"]
    for options in (("--force",), ()):
        assert invoke(*command, *options).exit_code == 0
    assert text.read_text(encoding="utf-8").startswith("# Toy")


@pytest.mark.parametrize(
    "arguments",
    [
        ("report", "RUN", "--out", "s3://bucket/r.html"),
        ("report", "RUN", "--markdown", "S3://bucket/r.md"),
        ("report", "RUN", "--figures", "file:///x"),
        ("export", "RUN", "--csv", "s3a://bucket/csv"),
        ("export", "RUN", "--xlsx", "gs://bucket/r.xlsx"),
        ("summarise", "RUN", "--picture", "abfs://bucket/r.png"),
    ],
)
def test_files_for_people_are_not_said_to_be_in_a_store(
    speed_run: Path, arguments, tmp_path
) -> None:
    with contextlib.chdir(tmp_path):
        done = invoke(*(speed_run if a == "RUN" else a for a in arguments))
    assert done.exit_code == 2
    assert "a URL is no file of this machine" in done.stderr
    assert list(tmp_path.iterdir()) == []


def invoke(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_report_command_writes_beside_the_folder(
    speed_run: Path, speed_page: str, tmp_path: Path
) -> None:
    from mcsettle.storage import manifest
    from mcsettle.storage.marks import marked
    from mcsettle.summary.results import study_of

    done = invoke("report", speed_run)
    assert done.exit_code == 0, done.output
    target = speed_run.with_name(speed_run.name + ".html")
    study = study_of(speed_run).identity
    assert target.read_bytes() == marked(speed_page.encode(), ".html", study)
    manifest.verify(speed_run)  # nothing was added to the results
    pictures, text = tmp_path / "pictures", tmp_path / "tables.md"
    done = invoke("report", speed_run, "--out", tmp_path / "a.html", "--figures",
                  pictures, "--markdown", text)  # fmt: skip
    assert done.exit_code == 0, done.output
    names = {p.name for p in pictures.glob("*.*") if p.is_file()}
    assert {"answer.svg", "answer.png", "answer.pdf", "sd_time.svg", "survival.pdf"} <= names
    # Away from its page a picture has no caption: the axis says what it is of.
    assert "price, pence per train-km" in (pictures / "answer.svg").read_text(encoding="utf-8")
    assert text.read_text(encoding="utf-8").startswith("# Toy")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("report", "nowhere"), "is no folder"),
        (("report", "RUN", "--out", "report.txt"), "ends in .html"),
        (("report", "RUN", "--variant", "bse"), "did you mean 'base'"),
        (("export", "RUN", "--xlsx", "book.csv"), "ends in .xlsx"),
        (("export", "nowhere"), "is no folder"),
        (("compare", "RUN", "nowhere"), "is no folder"),
    ],
)
def test_faults_are_told_plainly(speed_run: Path, arguments, said: str) -> None:
    done = invoke(*(speed_run if a == "RUN" else a for a in arguments))
    assert done.exit_code == 2
    assert said in done.stderr
    assert "Traceback" not in done.output


def test_the_picture_of_a_run_is_that_of_its_report(tmp_path: Path) -> None:
    """From Python too: SD until it is tamped and not between two days of the history; all is named."""
    made = made_run.study(run={"history_days": [0, 1095]}, economics={"price_base_year": 2021})
    folder = made_run.write(tmp_path / "run", made, {"v201": DAYS, "v225": 0.5 * DAYS})
    figure = plot(folder)
    sd = figure.axes[0]
    curve = next(line for line in sd.lines if line.get_label() == "225 km/h")
    days, middle = curve.get_data()
    assert days[np.argmax(np.asarray(middle) >= 1.499)] < 400.0  # the median interval is 350 days
    names = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert names[:2] == ["201 km/h", "225 km/h"]
    assert figure.get_suptitle().startswith("Toy: two linespeeds")


def test_every_picture_names_its_axes(speed_report: Page) -> None:
    page = speed_report
    names = [p.name for p in page.pictures]
    assert len(names) == len(set(names))
    for picture in page.pictures:
        assert re.search(r"\d", picture.alt), picture.name
        for axes in picture.figure.axes:
            assert axes.get_xlabel() or axes.get_xticklabels()
