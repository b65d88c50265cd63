"""Messages of the web libraries: what a peer sends cannot control the terminal, or fill it."""

import logging
from collections.abc import Iterator
from io import StringIO

import pytest

from stickslip_ros.app.dashboard import web_log
from stickslip_ros.app.dashboard.web_log import WebLog


@pytest.fixture
def printed() -> Iterator[StringIO]:
    """What a logger prints."""
    handler = WebLog()
    handler.stream = stream = StringIO()
    logger = logging.getLogger("web")
    logger.addHandler(handler)
    yield stream
    logger.removeHandler(handler)


def test_control_characters_of_a_path_are_escaped(printed: StringIO) -> None:
    path = "http://127.0.0.1:8642/\x1b]0;x\x07\x1b[31mrecording failed\x1b[2K\r\n\x00\x9b"
    logging.getLogger("web").warning(f"{path} not found")
    line = printed.getvalue()
    assert line.removesuffix("\n").isprintable()
    assert line.startswith("http://127.0.0.1:8642/\\x1b]0;x\\x07")


def test_an_error_is_one_line_without_where_it_occurred(printed: StringIO) -> None:
    logger = logging.getLogger("web")
    try:
        float("abc\n")
    except ValueError as error:
        logger.exception(error)
        logger.exception("Exception in ASGI application\n")
    logger.warning("the client is gone", stack_info=True)
    first, second, third = printed.getvalue().splitlines()
    assert first.startswith("ValueError(")
    assert second.startswith("Exception in ASGI application: ValueError(")
    assert third == "the client is gone"


def test_requests_do_not_fill_the_terminal(
    printed: StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr(web_log, "monotonic", lambda: now[0])
    logger = logging.getLogger("web")
    for _ in range(2):
        for number in range(1000):
            logger.warning("%d not found: %s", number, "x" * 10_000)
        now[0] += 61.0
    lines = printed.getvalue().splitlines()
    assert len(lines) == 2 * 11
    assert lines[10] == "further messages within 60 s are not shown"
    assert max(map(len, lines)) < 400
