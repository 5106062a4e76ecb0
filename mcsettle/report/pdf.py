"""The page printed to PDF by a headless Chromium (extra ``pdf``).

The same engine that shows the page prints it, so what was looked at is what is printed. The file's
dates are those of a fixed day: the same page gives the same bytes on one version of the browser.
"""

import os
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

from mcsettle.errors import InputError

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
VARIABLE = "MCSETTLE_BROWSER"
# The page needs nothing from elsewhere, and the browser shall not look for anything.
QUIET = [
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
FOOTER = (
    '<div style="font-size: 7pt; width: 100%; text-align: center; color: #555555">'
    '<span class="pageNumber"></span> / <span class="totalPages"></span></div>'
)
TAG = re.compile(rb"\(node(\d{8})\)")
DATE = re.compile(rb"/(CreationDate|ModDate) \(D:\d{14}")


def find_browser() -> str:
    """Path of a Chromium: ``MCSETTLE_BROWSER``, one on the path, or the one Playwright installed.

    Raises
    ------
    InputError
        The extra is not installed, or no browser is found.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise InputError(
            "a PDF needs the extra 'pdf': pip install 'mcsettle[pdf]'; or print the HTML file from a "
            "browser"
        ) from None
    named = os.environ.get(VARIABLE)
    if named:
        if Path(named).is_file():
            return named
        raise InputError(f"{VARIABLE} names {named}, which is no file")
    installed = next((path for name in NAMES if (path := shutil.which(name))), None)
    if installed:
        return installed
    with sync_playwright() as tool:
        bundled = tool.chromium.executable_path
    if Path(bundled).is_file():
        return bundled
    raise InputError(
        "a PDF needs Chromium: install it (package 'chromium', or 'playwright install chromium'), or "
        f"name it in {VARIABLE}; or print the HTML file from a browser"
    )


def launch_options(browser: str) -> dict[str, Any]:
    """How a headless browser is started; without its sandbox where the user is root."""
    sandbox = [] if hasattr(os, "geteuid") and os.geteuid() else ["--no-sandbox"]
    return {"executable_path": browser, "args": [*QUIET, *sandbox]}


def print_pdf(text: str) -> bytes:
    """An HTML page as PDF, A4: every part unfolded, pages numbered, bookmarks from the headings.

    Raises
    ------
    InputError
        As ``find_browser``.
    """
    browser = find_browser()
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as tool:
        path = Path(folder) / "report.html"
        path.write_text(text, encoding="utf-8")
        # Without time limits: on a busy machine a large page may take a minute.
        program = tool.chromium.launch(**launch_options(browser), timeout=0)
        page = program.new_page()
        page.set_default_timeout(0)
        page.goto(path.as_uri())
        page.evaluate("document.querySelectorAll('details').forEach(part => part.open = true)")
        content = page.pdf(
            prefer_css_page_size=True, print_background=True, tagged=True, outline=True,
            display_header_footer=True, header_template="<span></span>", footer_template=FOOTER,
        )  # fmt: skip
        program.close()
    return _numbered(DATE.sub(rb"/\1 (D:20000101000000", content))


def _numbered(content: bytes) -> bytes:
    """The tags' names counted from 1 in their order: the browser's own numbers differ each time."""
    names = sorted(set(TAG.findall(content)))
    rank = {name: b"%08d" % place for place, name in enumerate(names, 1)}
    return TAG.sub(lambda tag: b"(node" + rank[tag[1]] + b")", content)
