"""The first page of the studies with the most model forms: one screen of a desk, two of a telephone."""

from pathlib import Path
from typing import Any

import made_run
import numpy as np
import pytest

from mcsettle.report.build import read_report
from mcsettle.report.render import html
from mcsettle.study.study import load_study

pytestmark = pytest.mark.browser
STUDIES = Path(__file__).resolve().parents[2] / "studies"
TRACKS = 40
SCREENS = {"desk": (1280, 1000, 1), "telephone": (390, 844, 2)}  # width, height, screens


@pytest.fixture(scope="module", params=["linespeed", "traffic", "charges"])
def report(request: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Intervals three per cent shorter from scenario to scenario, the tracks of each 40 % apart."""
    study = load_study(STUDIES / f"{request.param}.toml").with_run(realisations=TRACKS)
    rng = np.random.default_rng(1)
    base = 697.0 * np.exp(0.4 * rng.standard_normal(TRACKS))
    days = {
        name: base * 0.97**i * np.exp(0.02 * rng.standard_normal(TRACKS))
        for i, name in enumerate(study.scenario_names)
    }
    folder = tmp_path_factory.mktemp(request.param)
    run = made_run.write(folder / "run", study, days)
    path = folder / "report.html"
    path.write_text(html(read_report(run)), encoding="utf-8")
    return path


@pytest.mark.parametrize("screen", list(SCREENS))
def test_the_answer_is_seen_without_scrolling_further(
    browser: Any, report: Path, screen: str
) -> None:
    width, height, screens = SCREENS[screen]
    page = browser.new_page(viewport={"width": width, "height": height})
    page.goto(report.as_uri())
    box = page.locator("#answer").bounding_box()
    assert box["y"] + box["height"] <= screens * height
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    axis = page.locator(".bars span.axis").first.bounding_box()
    assert axis["width"] >= 100
    link = page.locator("nav a").last
    link.click()  # the contents lead into a part that is folded
    target = page.locator(link.get_attribute("href"))
    assert target.evaluate("part => part.checkVisibility() && part.offsetHeight > 50")
    page.close()


def test_every_part_is_open_in_print(browser: Any, report: Path) -> None:
    page = browser.new_page()
    page.goto(report.as_uri())
    hidden = (
        "[...document.querySelectorAll('section div[id]')].filter(d => !d.checkVisibility()).length"
    )
    assert page.evaluate(hidden) > 5
    page.emulate_media(media="print")
    assert page.evaluate(hidden) == 0
    page.close()
