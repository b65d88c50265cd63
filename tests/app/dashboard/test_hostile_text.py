"""Hostile names and texts: they are shown as text, and nothing of them runs.

What the page parses, or runs, is a literal; and so it is in a real browser.
"""

import ast
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from playwright.sync_api import Browser, Page, expect
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter

from stickslip_ros.nodes.base.endpoints import message_class, qos_profile
from stickslip_ros.record.codec import pack_joint_state
from stickslip_ros.record.topics import DIAGNOSTICS, JOINT_STATES
from tests.app.dashboard.test_page import Served, Start, new_page
from tests.nodes.graph import Graph, wait_for

RUN = "window.ran=1;fetch('http://evil.invalid/')"
PAYLOADS = [
    f'" innerHTML="<img src=x onerror={RUN}>',
    f"' :innerHTML='(()=>{{{RUN}}})()'",
    f'x" onmouseover="{RUN}" autofocus onfocus="{RUN}',
    f'<img src="http://evil.invalid/i.png" onerror="{RUN}">',
    f"<script>{RUN}</script>",
    f"</script><script>{RUN}</script>",
    f"<svg/onload={RUN}>",
    f'<iframe srcdoc="<script>parent.{RUN}</script>"></iframe>',
    '<link rel=stylesheet href="http://evil.invalid/c.css"><style>@import "//evil.invalid"</style>',
    f'<a href="javascript:{RUN}">link</a>',
    f"[link](javascript:{RUN}) ![i](http://evil.invalid/i.png)",
    f"{{{{constructor.constructor('{RUN}')()}}}}",
    f"{{a}} {{b}} {{@x}} {{rich|<img src=x onerror={RUN}>}}",
    f"`${{(()=>{{{RUN}}})()}}`",
    f"```\n<img src=x onerror={RUN}>\n```",
    f'");{RUN};("',
    f"');{RUN};('",
    f"\\');{RUN}//",
    f"\u2028;{RUN};\u2029",
    "\x1b[2J\x1b]0;title\x07 \u202e\u200b",
    f"&lt;img src=x onerror={RUN}&gt; &#60;script&#62;{RUN}",
]
PARSED = [
    "<img src=x onerror='window.ran=1'>",
    "<iframe srcdoc='<script>parent.ran=1</script>'></iframe>",
    "<img src='http://evil.invalid/i.png'>",
    "<style>@import 'http://evil.invalid/c.css'</style>",
    "<form action='http://evil.invalid/'><button id=go></button></form>",
]


@pytest.fixture
def guarded(browser: Browser) -> Iterator[tuple[Page, list[str]]]:
    """A page, and what it did that it must not: errors, violations, requests to others."""
    page = new_page(browser)
    noted: list[str] = []
    page.on("pageerror", lambda error: noted.append(f"error: {error}"))
    page.on("dialog", lambda dialog: (noted.append("dialog"), dialog.dismiss()))
    page.on("popup", lambda popup: noted.append(f"popup: {popup.url}"))
    page.on("console", lambda line: "Security Policy" in line.text and noted.append(line.text))
    page.on("request", lambda request: _is_foreign(request.url) and noted.append(request.url))
    yield page, noted
    page.close()


def _is_foreign(url: str) -> bool:
    return urlsplit(url).hostname not in ("127.0.0.1", None)


@pytest.mark.long
def test_nothing_that_a_node_publishes_runs(
    start_stickslip: Start, graph: Graph, guarded: tuple[Page, list[str]]
) -> None:
    page, noted = guarded
    served = Served(start_stickslip("dashboard", "--namespace", "/test"))
    page.goto(served.url)
    expect(page.get_by_text("No drive is running in /test")).to_be_visible()
    assert noted == []
    for html in PARSED:  # the policy alone stops it
        with page.expect_console_message(lambda line: "Security Policy" in line.text):
            page.evaluate("html => document.body.insertAdjacentHTML('beforeend', html)", html)
            page.evaluate("document.querySelector('#go')?.click()")
    assert page.evaluate("window.ran") is None
    page.reload()
    noted.clear()
    node = graph.observer
    diagnostics = node.create_publisher(DiagnosticArray, DIAGNOSTICS.name, 100)
    changes = node.create_publisher(ParameterEvent, "/parameter_events", 100)
    kind = message_class(JOINT_STATES.type_name)
    states = node.create_publisher(kind, f"/test/{JOINT_STATES.name}", qos_profile(JOINT_STATES))

    def publish(payload: str) -> None:
        """Publish a text wherever a node can."""
        values = [KeyValue(key=payload, value=payload)]
        values += [
            KeyValue(key=key, value=payload)
            for key in ("state", "regime", "trend", "bag", "samples", "late_forces", "answered")
        ]
        names = "plant", "analyzer", "washout_controller", payload
        status = [
            DiagnosticStatus(name=f"/test/{name}", message=payload, values=values) for name in names
        ]
        diagnostics.publish(DiagnosticArray(status=status))
        for name in ("pace", "friction.file", payload):
            value = [Parameter(name, value=payload).to_parameter_msg()]
            changes.publish(ParameterEvent(node="/test/plant", changed_parameters=value))

    graph.wait_until(diagnostics.get_subscription_count, "the dashboard listens")
    graph.wait_until(states.get_subscription_count, "the dashboard listens")
    for number, payload in enumerate(PAYLOADS, start=1):
        publish(payload)
        states.publish(pack_joint_state(number, (0, 0), (0, 0), (0, 0)))
        graph.run_for(0.01)
    page.get_by_text("all values").click()
    log = page.get_by_role("log")
    texts = [" ".join(payload.split()) for payload in PAYLOADS]
    wait_for(
        lambda: all(text in " ".join(log.inner_text().split()) for text in texts), "every payload"
    )
    node.destroy_publisher(states)
    graph.wait_until(lambda: not node.count_publishers("/test/joint_states"), "it has left")
    expect(page.get_by_role("heading", name="Run ended")).to_be_visible()
    assert page.get_by_role("link", name="Download").count() == 0
    for one in page.get_by_role("img").all():
        one.hover()
    assert page.evaluate("window.ran") is None
    assert noted == []
    assert served.end() == 130
    assert "Traceback" not in "".join(served.said)


MODULES = sorted((Path(__file__).parents[3] / "stickslip_ros/app/dashboard").glob("*.py"))

LITERALS = {
    *("props", "style", "classes", "html", "markdown", "code", "mermaid", "restructured_text"),
    *("add_head_html", "add_body_html", "add_css", "add_slot", "run_javascript"),
}
"""Methods of NiceGUI whose arguments are props, HTML, a template or a script."""

PAGE_JS = ast.unparse(
    ast.parse(
        "ui.run_javascript(f\"stickslip.{function}({', '.join(map(json.dumps, arguments))})\")"
    )
)
"""The one exception: a function of page.js, with JSON as its arguments."""


def offences(code: str) -> list[str]:
    """Return the calls in which something else than a literal is parsed or run."""
    found: list[str] = []
    for call in [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Call)]:
        name = call.func.attr if isinstance(call.func, ast.Attribute) else ""
        given = call.args if name in LITERALS else []
        given += [k.value for k in call.keywords if k.arg == "js_handler"]
        if not all(isinstance(each, ast.Constant) for each in given):
            found.append(ast.unparse(call))
    return [each for each in found if each != PAGE_JS]


def test_only_literals_are_parsed_and_text_comes_as_json() -> None:
    texts = {path.name: path.read_text(encoding="utf-8") for path in MODULES}
    assert {name: offences(text) for name, text in texts.items()} == {name: [] for name in texts}
    assert [name for name, text in texts.items() if PAGE_JS in ast.unparse(ast.parse(text))] == [
        "elements.py"
    ]
