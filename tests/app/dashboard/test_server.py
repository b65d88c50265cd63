"""Answers of the server to requests and messages that no page sends: no traceback."""

from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from stickslip_ros.app.dashboard.frames import Frames
from stickslip_ros.app.dashboard.page import Pages
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
