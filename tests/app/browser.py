"""A real browser, for the tests of the dashboard."""

import os
import shutil
from collections.abc import Generator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, sync_playwright

_NAMES = ("chromium", "chromium-browser", "google-chrome")
_QUIET = ("--disable-gpu", "--disable-background-networking", "--disable-component-update")


@contextmanager
def headless_browser() -> Generator[Browser]:
    """Run the system's Chromium; skip the test where there is none, but not in CI."""
    executable = next(filter(None, map(shutil.which, _NAMES)), None)
    if executable is None:
        missing = f"there is no browser: none of {', '.join(_NAMES)} is installed"
        if os.environ.get("CI"):
            pytest.fail(missing)
        pytest.skip(missing)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(_QUIET))
        yield browser
        browser.close()
