"""Serve the page, loopback only, next to the ROS node that listens for it; and what it logs."""

import logging
import signal
import socket
import sys
import threading
from collections.abc import Awaitable, Callable, Collection, Generator
from contextlib import contextmanager
from pathlib import Path
from secrets import token_urlsafe
from time import monotonic
from traceback import extract_tb
from typing import TextIO

import uvicorn
from fastapi import FastAPI, Request, Response
from fastapi.middleware.trustedhost import TrustedHostMiddleware
from jinja2 import DictLoader
from nicegui import client, core, ui
from rclpy.task import Future

from stickslip_ros.app.dashboard import HOST
from stickslip_ros.app.dashboard.frames import Frames
from stickslip_ros.app.dashboard.listener import ListenerNode
from stickslip_ros.app.dashboard.page import Pages
from stickslip_ros.app.dashboard.run_state import RunState
from stickslip_ros.nodes.base.process import ros_session
from stickslip_ros.nodes.base.spinner import Spinner, spin
from stickslip_ros.text import printable

_RECONNECT_TIME = 30.0
"""Time, s, for which a page without connection is kept; then it is loaded again.

A page that does not answer for longer than this counts as one without connection.
"""

_POLICY = (
    "default-src 'none'; script-src 'self' 'nonce-{nonce}' 'unsafe-eval'; connect-src 'self'; "
    "style-src 'self' 'unsafe-inline'; font-src 'self'; img-src 'self' data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
"""Sources that the page may load and run; docs/security.md says what NiceGUI needs of them."""

_MOST_LINES, _PERIOD = 10, 60.0
"""Lines that are printed in each period, s."""
_LONGEST_LINE = 300


def serve(
    namespace: str, listening: socket.socket, reach: str, readable: Collection[str], command: str
) -> None:
    """Serve the page of a namespace on a socket that listens, until SIGINT or SIGTERM.

    `reach` describes which nodes can be heard; of the paths that they name, those that are
    `readable` are read. The `command` that started the run is shown; empty if it is not known.
    """
    signal.signal(signal.SIGTERM, _exit)  # uvicorn passes it on when it ends
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        signal.signal(signal.SIGHUP, _exit)
    with ros_session() as spinner:
        run = RunState(namespace, readable, command)
        frames = Frames(run)
        listener = ListenerNode(run, frames.feed)
        with _running(spinner, listener):
            log_here_alone()
            app = FastAPI(openapi_url=None)
            _keep_others_out(app)
            pages = Pages(app, listener, frames)
            title = f"stickslip {namespace}"
            ui.run_with(
                app,
                title=title,
                language="en-US",
                show_welcome_message=False,
                reconnect_timeout=_RECONNECT_TIME,
            )
            host, port = listening.getsockname()
            print(f"dashboard of {namespace}, {reach}: http://{host}:{port}", file=sys.stderr)
            config = uvicorn.Config(
                app,
                log_config=None,  # that of this process
                log_level="warning",
                timeout_graceful_shutdown=1,
                ws_per_message_deflate=False,  # slower than the loopback
            )
            _Server(config, pages.take_leave).run(sockets=[listening])


class _Server(uvicorn.Server):
    """A server that takes leave of its pages before it ends."""

    def __init__(self, config: uvicorn.Config, take_leave: Callable[[], Awaitable[None]]) -> None:
        super().__init__(config)
        self._take_leave = take_leave

    async def main_loop(self) -> None:
        await super().main_loop()
        await self._take_leave()


def _keep_others_out(app: FastAPI) -> None:
    """Keep others from controlling the drive: by host name, frame, or script, also in a text."""
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"])
    core.sio.eio.cors_allowed_origins = None  # the page's own origin only
    # In the template, before there is any text of others: the scripts of NiceGUI, and no other.
    template = client.templates.get_template("index.html")
    source = Path(str(template.filename)).read_text(encoding="utf-8")
    nonced = source.replace("<script", '<script nonce="{{ request.state.nonce }}"')
    client.templates.env.loader = DictLoader({"index.html": nonced})

    @app.middleware("http")
    async def restrict(  # pyright: ignore[reportUnusedFunction]
        request: Request, answer: Callable[[Request], Awaitable[Response]]
    ) -> Response:
        request.state.nonce = token_urlsafe()
        response = await answer(request)
        policy = _POLICY.format(nonce=request.state.nonce)
        response.headers["Content-Security-Policy"] = policy
        response.headers["X-Content-Type-Options"] = "nosniff"
        return response


def _exit(*_: object) -> None:
    sys.exit(0)


@contextmanager
def _running(spinner: Spinner, node: ListenerNode) -> Generator[None]:
    spinner.add(node)
    stop = Future()
    thread = threading.Thread(target=spin, args=(spinner.executor, stop), name="ros", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stop.set_result(None)
        spinner.executor.wake()
        thread.join()
        node.close()


class WebLog(logging.StreamHandler[TextIO]):
    """Handler that prints messages to stderr, with errors named, but not where they occurred."""

    def __init__(self) -> None:
        super().__init__(sys.stderr)
        self._begun, self._lines = -_PERIOD, 0

    def format(self, record: logging.LogRecord) -> str:
        """Return a message on one line, with control characters escaped."""
        text, error = record.getMessage().strip(), record.exc_info and record.exc_info[1]
        frames = extract_tb(error.__traceback__)[-1:] if error else []
        if any(Path(frame.filename).parent.name in ("engineio", "socketio") for frame in frames):
            text = "a client sent a message that no page sends"
        if error:
            text = repr(error) if text == str(error).strip() else f"{text}: {error!r}"
        line = printable(text)
        return line if len(line) <= _LONGEST_LINE else f"{line[:_LONGEST_LINE]}..."

    def emit(self, record: logging.LogRecord) -> None:
        """Print a message, unless there were too many in this period."""
        if record.name == "nicegui" and record.stack_info:
            return  # a page was updated that has been closed: nobody misses it
        now = monotonic()
        if now - self._begun >= _PERIOD:
            self._begun, self._lines = now, 0
        self._lines += 1
        if self._lines <= _MOST_LINES:
            super().emit(record)
        elif self._lines == _MOST_LINES + 1:
            self.stream.write(f"further messages within {_PERIOD:.0f} s are not shown\n")
            self.flush()


def log_here_alone() -> None:
    """Let what all libraries log go through one `WebLog`; some have handlers of their own."""
    logging.basicConfig(handlers=[WebLog()], level=logging.WARNING, force=True)
    for name in logging.root.manager.loggerDict:
        logging.getLogger(name).handlers.clear()
