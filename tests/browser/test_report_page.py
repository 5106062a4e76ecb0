"""The report opened in a real browser: quiet, whole, legible on a telephone, in the dark and on paper.

Run by ``pytest -m browser`` where Playwright and a Chromium are installed; skipped elsewhere.
"""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import made_run
import numpy as np
import pytest

from mcsettle.errors import InputError
from mcsettle.report.build import read_report
from mcsettle.report.pdf import find_browser
from mcsettle.report.render import html

pytestmark = pytest.mark.browser
LEGIBLE = 8.5  # px of a figure's text on a telephone
LEGIBLE_PRINT = 5.5  # pt
PHONE = {"width": 390, "height": 844}
DAYS = np.linspace(500.0, 900.0, 41)
A4 = 794 - 2 * 53  # px between the margins of a page
SIZES = """() => [...document.querySelectorAll('.card svg')].map(s => {
  const box = s.getBoundingClientRect();
  const size = t => { const m = t.getScreenCTM();
    return parseFloat(getComputedStyle(t).fontSize) * Math.hypot(m.a, m.b); };
  const texts = [...s.querySelectorAll('text')].map(size);
  return [s.closest('figure').id, box.width, box.height, Math.min(...texts), texts.length];
})"""
COLOURS = """() => { const b = getComputedStyle(document.body);
  return [b.backgroundColor, b.color,
          getComputedStyle(document.querySelector('.card svg text')).fill]; }"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with every kind of block; the pictures of the track on the closed-form one."""
    title = "<script>document.title = 'run'</script> a long title of a study, " * 3
    made = made_run.study(
        title=title,
        reference=[{"metric": "tamping_interval_days", "scenario": "v201", "value": 697.0,
                    "unit": "d", "source": "Table 3"}],
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("report")
    run = made_run.write(folder / "run", made, {"v201": DAYS, "v225": 0.8 * DAYS})
    path = folder / "report.html"
    path.write_text(html(read_report(run)), encoding="utf-8")
    return path


def opened(browser: Any, path: Path, **options: Any) -> tuple[Any, list[str], list[str]]:
    """A page, what it said on its console, and what it asked of others."""
    page = browser.new_page(**options)
    said: list[str] = []
    asked: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri())
    return page, said, asked


def test_quiet_and_self_contained(browser: Any, report: Path) -> None:
    page, said, asked = opened(browser, report)
    assert said == []
    assert [url for url in asked if not url.startswith("data:")] == [report.as_uri()]
    assert page.title().startswith("<script>")  # shown, not run
    assert page.locator("script").count() == 0


def test_every_figure_has_size_and_legible_text_on_a_telephone(browser: Any, report: Path) -> None:
    page, _, _ = opened(browser, report, viewport=PHONE)
    width = page.evaluate("document.documentElement.scrollWidth")
    assert width <= PHONE["width"]  # wide tables scroll by themselves
    found = page.evaluate(SIZES)
    assert len(found) >= 6
    for name, wide, high, least, n in found:
        assert wide > 250, name
        assert high > 80, name
        assert n > 3, name
        assert least >= LEGIBLE, name
    body = page.evaluate("parseFloat(getComputedStyle(document.querySelector('p')).fontSize)")
    assert body >= 16
    least = page.evaluate(
        "Math.min(...[...document.querySelectorAll('td, figcaption')].map("
        "e => parseFloat(getComputedStyle(e).fontSize)))"
    )
    assert least >= 12.5


def test_dark_window(browser: Any, report: Path) -> None:
    page, _, _ = opened(browser, report, color_scheme="dark")
    ground, ink, text = page.evaluate(COLOURS)
    lightness = [sum(int(v) for v in c[4:-1].split(",")) / 3 for c in (ground, ink, text)]
    assert lightness[0] < 60
    assert min(lightness[1:]) > 180  # of the pictures' text too
    assert "#000000" not in page.evaluate("document.querySelector('.card').innerHTML")


def test_on_paper(browser: Any, report: Path) -> None:
    page, _, _ = opened(browser, report, viewport={"width": A4, "height": 1000})
    page.emulate_media(media="print")
    for name, wide, _, least, _ in page.evaluate(SIZES):
        assert wide <= A4, name
        assert least * 0.75 >= LEGIBLE_PRINT, name
    over = page.evaluate(
        "[...document.querySelectorAll('table')].filter("
        f"t => t.getBoundingClientRect().width > {A4} + 1).map(t => t.caption.textContent)"
    )
    assert over == []


def test_pdf_is_the_same_twice(report: Path, browser: Any, tmp_path: Path) -> None:
    run, program = report.with_name("run"), Path(sys.executable).with_name("mcsettle")
    written = []
    for name in ("a", "b"):
        out = tmp_path / f"{name}.html"
        command = [program, "report", run, "--pdf", "--out", out]
        subprocess.run(command, check=True, capture_output=True)
        written.append(out.with_suffix(".pdf").read_bytes())
    assert written[0].startswith(b"%PDF")
    assert written[0] == written[1]


def test_missing_browser_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("playwright")
    monkeypatch.setenv("MCSETTLE_BROWSER", "/nowhere/chromium")
    with pytest.raises(InputError, match="is no file"):
        find_browser()
    monkeypatch.delenv("MCSETTLE_BROWSER")
    if shutil.which("chromium"):
        assert find_browser() == shutil.which("chromium")
