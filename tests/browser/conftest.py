"""One browser for the tests of a file."""

from collections.abc import Iterator
from typing import Any

import pytest

from mcsettle.errors import InputError
from mcsettle.report.pdf import find_browser, launch_options


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    try:
        path = find_browser()
    except InputError as error:
        pytest.skip(f"no browser: {error}")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as tool:
        program = tool.chromium.launch(**launch_options(path))
        yield program
        program.close()
