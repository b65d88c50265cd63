"""Take the screenshots of the dashboard for the docs: `python -m docs.screenshot DIRECTORY`.

dashboard.png is for README.md and docs/dashboard.md, dashboard-dark.png for the latter.
"""

import re
import subprocess
import sys
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page

from tests.app.browser import headless_browser

# In slow motion a small machine has time for the browser, too, and no deadline is missed.
_RUN = (
    *("run", "feed_drive", "--bag", "bag"),
    *("-p", "plant.real_time_factor=0.025", "-p", "washout_controller.start_after=1.5"),
)
_TIMEOUT = 120.0
_NEWEST_AMPLITUDE = (
    "window.getElement(stickslip.cycles)?.chart.getOption().series[0].data?.at(-1)?.[1]"
)
_LATE = "lower rate or real_time_factor"
"""Advice of health and events where forces or samples are late."""


def main(directory: Path) -> str | None:
    """Take the pictures while the limit cycle collapses; return what is wrong with them."""
    with headless_browser() as browser, _started("dashboard") as dashboard:
        page = browser.new_page(viewport={"width": 1400, "height": 1060})
        page.goto(_address(dashboard), timeout=_TIMEOUT * 1000.0)
        with _started(*_RUN):  # once the page is there: to load it takes both cores
            page.wait_for_function(f"{_NEWEST_AMPLITUDE} > 420", timeout=_TIMEOUT * 1000.0)
            page.get_by_role("button", name="Store A").click()
            page.wait_for_function(f"{_NEWEST_AMPLITUDE} < 200", timeout=_TIMEOUT * 1000.0)
            _picture(page, directory / "dashboard.png")
            page.emulate_media(color_scheme="dark")
            page.set_viewport_size({"width": 800, "height": 1060})
            page.wait_for_timeout(1000.0)
            _picture(page, directory / "dashboard-dark.png")
            late = page.get_by_text(_LATE).count() > 0
    return (
        "the pictures show forces or samples that are late: this machine is busy" if late else None
    )


def _picture(page: Page, file: Path) -> None:
    """Write the whole page in few colours, which makes the file a third as large."""
    with Image.open(BytesIO(page.screenshot(full_page=True))) as image:
        image.convert("RGB").quantize(128).save(file, optimize=True)


@contextmanager
def _started(*arguments: str) -> Generator[subprocess.Popen[str]]:
    """Start a command in a directory of its own, and end it."""
    with tempfile.TemporaryDirectory() as directory:
        command = [sys.executable, "-m", "stickslip_ros.app.main", *arguments]
        process = subprocess.Popen(
            command, cwd=directory, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        try:
            yield process
        finally:
            process.terminate()
            process.communicate()


def _address(dashboard: subprocess.Popen[str]) -> str:
    for line in dashboard.stderr:
        if found := re.search(r"http://127\.0\.0\.1:\d+", line):
            return found[0]
    raise RuntimeError("the dashboard has ended without a page")


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
