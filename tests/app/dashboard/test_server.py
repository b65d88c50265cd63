"""Requests and messages that no page sends: answered and logged without a traceback."""

import logging
import sys
from collections.abc import Iterator
from io import StringIO
from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi import FastAPI
from nicegui import core
from socketio.packet import Packet
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from stickslip_ros.app.dashboard import server
from stickslip_ros.app.dashboard.frames import Frames
from stickslip_ros.app.dashboard.page import Pages
from stickslip_ros.app.dashboard.server import WebLog, log_here_alone
from tests.app.dashboard.test_frames import fed

ORIGIN = {"origin": "http://testserver"}


@pytest.fixture(scope="module")
def client() -> TestClient:
    """Return a client to which an exception of the server is raised."""
    app = FastAPI()
    frames: Frames = fed({}, 1.0, 100.0)
    listener: Any = SimpleNamespace(run=frames._run)
    Pages(app, listener, frames)
    return TestClient(app)


def test_any_query_is_answered(client: TestClient) -> None:
    numbers = "abc", "nan", "inf", "-1", "1e308", "9" * 400, "9" * 5000, ""
    for periods, end in product(("10", *numbers), numbers):
        answer = client.get("/shown.csv", params={"periods": periods, "end": end})
        assert answer.status_code == 422, (periods, end)


def test_a_query_of_other_names_is_refused(client: TestClient) -> None:
    assert client.get("/shown.csv?samples=abc").status_code == 422
    assert client.get("/shown.csv?periods=10&end=0.5").text.startswith("time,position")


def test_a_frame_that_no_page_sends_ends_the_connection(client: TestClient) -> None:
    for message in (b"50", b"", "abc", "", "9" * 400, "nan"):
        with client.websocket_connect("/frames", headers=ORIGIN) as socket:
            socket.send_text("50")
            assert socket.receive_bytes()
            send: Any = socket.send_bytes if isinstance(message, bytes) else socket.send_text
            send(message)
            with pytest.raises(WebSocketDisconnect):
                socket.receive_bytes()


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
    logger.warning("somewhere", stack_info=True)
    first, second, third = printed.getvalue().splitlines()
    assert first.startswith("ValueError(")
    assert second.startswith("Exception in ASGI application: ValueError(")
    assert third == "somewhere"


def test_a_message_that_no_page_sends_is_named_as_that_and_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """By a logger of a library, too, which has a handler of its own."""
    logger, before = logging.getLogger("engineio.server"), logging.root.handlers[:]
    assert core.sio.eio.logger is logger
    logger.addHandler(logging.StreamHandler(sys.stderr))
    log_here_alone()
    try:
        Packet(encoded_packet=b"\0\1")
    except ValueError:
        logger.exception("message async handler error")
    finally:
        logging.root.handlers[:] = before
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("a client sent a message that no page sends: ValueError(")


def test_a_page_that_is_updated_when_it_is_closed_is_not_told_of(printed: StringIO) -> None:
    (handler,) = logging.getLogger("web").handlers
    logging.getLogger("nicegui").addHandler(handler)
    logging.getLogger("nicegui").warning("Client has been deleted", stack_info=True)
    logging.getLogger("nicegui").removeHandler(handler)
    assert printed.getvalue() == ""


def test_requests_do_not_fill_the_terminal(
    printed: StringIO, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr(server, "monotonic", lambda: now[0])
    logger = logging.getLogger("web")
    for _ in range(2):
        for number in range(1000):
            logger.warning("%d not found: %s", number, "x" * 10_000)
        now[0] += 61.0
    lines = printed.getvalue().splitlines()
    assert len(lines) == 2 * 11
    assert lines[10] == "further messages within 60 s are not shown"
    assert max(map(len, lines)) < 400
