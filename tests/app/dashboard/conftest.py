from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

from tests.app.browser import headless_browser
from tests.nodes.conftest import (  # noqa: F401 - fixtures used here
    _this_machine_only,
    graph,
    often_diagnosed,
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with headless_browser() as browser:
        yield browser
