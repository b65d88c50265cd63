"""The dashboard end to end: a real browser, a real server, real nodes."""

import math
import re
import shlex
import signal
import socket
import subprocess
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Locator, Page, expect

from stickslip_ros.record.reader import Recording
from tests.app.conftest import Start
from tests.nodes.conftest import processes  # noqa: F401 - a fixture used here
from tests.nodes.graph import PATIENCE, wait_for
from tests.nodes.processes import Processes

pytestmark = pytest.mark.long

expect.set_options(timeout=PATIENCE * 1000.0)


def new_page(browser: Browser) -> Page:
    """Open an empty page, whose waits are as long as those of nodes."""
    page = browser.new_page(viewport={"width": 1400, "height": 1060})
    page.set_default_timeout(PATIENCE * 1000.0)
    return page


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    page = new_page(browser)
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    yield page
    page.close()
    assert not errors


class Served:
    """A command that serves the page, and what it says."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self.process = process
        self.said: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def url(self) -> str:
        """Wait for its address for as long as the process lives and the test may last."""

        def found() -> list[str]:
            addresses = re.findall(r"http://127\.0\.0\.1:\d+", "".join(self.said))
            assert addresses or self.process.poll() is None, f"it ended and said {self.said}"
            return addresses

        wait_for(found, "the address of the page", patience=math.inf)
        return found()[0]

    def end(self) -> int:
        """Interrupt it and return its status."""
        self.process.send_signal(signal.SIGINT)
        status = self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        assert not re.findall(r"^\w+(?:Error|Exception)\(.*", "".join(self.said), re.MULTILINE)
        return status

    def _read(self) -> None:
        self.said += iter(self.process.stderr.readline, "")


SWING = """() => {
    const values = [...(stickslip.motion?.lines.position.y ?? [])].filter((y) => y === y);
    return values.length ? Math.max(...values) - Math.min(...values) : -1;
}"""
# An impulse leaves the window before a busy machine may look.
LARGEST_SWING = f"""() => {{
    window.largestSwing = -1;
    setInterval(() => {{ largestSwing = Math.max(largestSwing, ({SWING})()); }}, 50);
}}"""


def swing(page: Page) -> float:
    """Return peak to peak of the displacement that is drawn, in its unit; -1 for none."""
    return page.evaluate(SWING)


def events(page: Page) -> Locator:
    return page.get_by_role("log")


def last_amplitude(page: Page) -> float:
    """Return the amplitude of the last cycle that the chart shows, in its unit."""
    return page.evaluate("""() => {
        const cycles = window.getElement(stickslip.cycles).chart.getOption().series[0].data;
        return cycles.length ? cycles[cycles.length - 1][1] : Infinity;
    }""")


# A click is a message to each listener; those to all but the first come later than a refresh.
DELAYED = """() => {
    const emit = window.socket.emit.bind(window.socket);
    const first = {};
    window.socket.emit = (kind, message, ...rest) => {
        const listener = kind === "event" ? message.listener_id : null;
        first[message.id] ??= listener;
        setTimeout(
            () => emit(kind, message, ...rest), listener === first[message.id] ? 0 : 500
        );
    };
}"""

DISCONNECTED = """() => {
    socket.io.reconnectionDelay(2000);
    socket.io.randomizationFactor(0);
    socket.io.engine.close();
}"""
"""The page loses its connection, and tries to have it again after 2 s."""

FRICTION = """() => {
    const series = window.getElement(stickslip.friction)?.chart?.getOption()?.series ?? [];
    return series.find((one) => one.name === "steady sliding")?.data[0][0] ?? null;
}"""
"""Relative speed of the operating point on the friction curve, in its unit."""


LOOK = """() => {
    const { darkMode, legend, yAxis } = window.getElement(stickslip.trace).chart.getOption();
    const above = document.querySelector(".tall .lines");
    const { data } = above.getContext("2d").getImageData(0, 0, above.width, above.height);
    return { darkMode, legend: legend[0].data, label: yAxis[0].name, marks: data.some(Boolean) };
}"""
"""How the time plots look; of a paused view only marks lie above the chart."""

CHANGED = re.compile(r"t = .* s: \w+\.\w+: .* to ")
"""An event that says that a parameter has changed."""

SWITCHED_OFF = re.compile("t = .* s: washout_controller inactive")
"""An event of a run that moves: a controller that waits to be active is inactive, too."""

SLOW = (
    *("run", "feed_drive", "--dashboard", "--bag", "bag"),
    *("-p", "plant.real_time_factor=0.5", "-p", "plant.rate=500"),
    *("-p", "washout_controller.start_after=0"),
)
"""A run in slow motion: a busy machine has time for each answer."""


def test_a_limit_cycle_is_seen_stopped_and_changed_until_the_motion_diverges(
    start_stickslip: Start, page: Page, tmp_path: Path
) -> None:
    served = Served(start_stickslip(*SLOW))
    page.goto(served.url)
    control = page.get_by_role("switch", name="washout controller")
    expect(control).to_be_checked()
    # The plant does not start without the controller.
    expect(page.get_by_role("row", name="plant active")).to_be_visible()

    control.click()
    expect(events(page).get_by_text(SWITCHED_OFF)).to_be_visible()
    page.get_by_role("button", name="Reset").click()
    expect(page.get_by_text("stick-slip", exact=True)).to_be_visible()
    expect(page.get_by_text(re.compile(r"^43\d(\.\d+)? µm$"))).to_be_visible()
    wait_for(lambda: swing(page) > 800.0, "the limit cycle is drawn")  # µm
    expect(control).not_to_be_checked()

    control.click()
    expect(control).to_be_checked()
    wait_for(lambda: last_amplitude(page) < 200.0, "the limit cycle collapses")
    expect(page.get_by_text("steady sliding", exact=True)).to_be_visible()
    page.get_by_text("10 periods").click()
    wait_for(lambda: 0.0 <= swing(page) < 50.0, "the collapse is drawn")

    header = page.get_by_text(re.compile(r"^t = .* s, late forces .* %, missed deadlines .* %, "))
    expect(header).to_contain_text("recording to bag, stickslip run feed_drive --dashboard")
    speed = page.get_by_label("belt speed, value")
    expect(speed).to_have_value("40")
    alerts = page.get_by_role("alert").filter(visible=True)
    for mistyped, answer in {
        "0,02": "'0,02' is invalid: must be a number with a decimal point in m/s",
        "-5e9": "-5 Mm/s is invalid: must be at most 1 m/s in size",
        "": "'' is invalid: must be a number in m/s",
    }.items():
        speed.fill(mistyped)
        speed.press("Enter")
        expect(alerts.filter(has_text=answer)).to_be_visible()
    for field in (speed, page.get_by_role("slider", name="belt speed")):
        field.hover()
        field.focus()
        page.mouse.wheel(0, 500)

    # A page that loses its connection for seconds, on a busy machine, keeps what was typed.
    speed.fill("35mm/s")
    page.evaluate(DISCONNECTED)
    page.wait_for_function("socket.connected")
    speed.press("Enter")
    # What was refused, or scrolled over, has changed nothing: this is the only change.
    only = re.compile("plant.belt_speed: 40 mm/s to 35 mm/s$")
    expect(events(page).get_by_text(CHANGED)).to_have_text([only])
    expect(page.get_by_role("button", name="10 periods")).to_have_attribute("aria-pressed", "true")

    new_speed = pytest.approx(-35.0)  # mm/s
    wait_for(lambda: page.evaluate(FRICTION) == new_speed, "the new belt speed is in the curve")
    page.get_by_role("button", name="undo belt speed").click()
    expect(events(page).get_by_text("plant.belt_speed: 35 mm/s to 40 mm/s")).to_be_visible()
    expect(speed).to_have_value("40")  # mm/s, as in the plots

    corner = page.get_by_label("cutoff frequency, value")
    corner.fill("-3")
    corner.press("Enter")
    refusal = "corner_frequency = -3.0 is invalid: must be a finite number above 0"
    expect(page.get_by_role("alert").get_by_text(re.compile(re.escape(refusal)))).to_be_visible()
    expect(events(page).get_by_text("washout_controller refused")).to_be_visible()
    expect(corner).to_have_value("20")

    page.get_by_label("another parameter").click()
    page.get_by_role("option", name="plant.damping = 200 N s/m").click()
    expect(page.get_by_text("Now 200 N s/m.")).to_be_visible()
    value = page.get_by_label("value", exact=True)
    value.fill("fast")
    value.press("Enter")
    expect(page.get_by_text("'fast' is invalid: must be a number in N s/m")).to_be_visible()
    value.fill("0.25 kN s/m")
    value.press("Enter")
    expect(page.get_by_text("Now 250 N s/m.")).to_be_visible()

    page.get_by_role("button", name="50 periods").click()
    page.wait_for_function("stickslip.motion.window > 3")  # s: a period takes 63 ms
    wait_for(lambda: 0.0 <= swing(page) < 50.0, "the slide is at rest again")
    page.evaluate(LARGEST_SWING)
    page.get_by_role("button", name="Impulse").click()
    expect(events(page).get_by_text("impulse of 250 N for 16 ms")).to_be_visible()
    expect(events(page).get_by_text("the impulse has ended")).to_be_visible()
    wait_for(lambda: page.evaluate("largestSwing") > 50.0, "the impulse is drawn")

    # A click that arrives in parts switches the controller nevertheless.
    page.evaluate(DELAYED)
    control.click()
    expect(events(page).get_by_text(SWITCHED_OFF)).to_have_count(2)
    expect(control).not_to_be_checked()

    gain = page.get_by_label("cubic gain, value")
    gain.fill("9")  # MN s^3/m^3: the force grows faster than what damps the slide
    gain.press("Enter")
    expect(events(page).get_by_text("washout_controller.cubic_gain: 0")).to_be_visible()
    page.get_by_role("button", name="Reset").click()
    wait_for(lambda: swing(page) > 800.0, "the limit cycle is drawn")  # µm
    page.evaluate("Object.defineProperty(document, 'hidden', { get: () => true })")
    control.click()
    expect(page.get_by_role("heading", name="Run ended: the motion diverges")).to_be_visible()
    wait_for(lambda: swing(page) > 1e4, "the end is drawn, on a hidden page, too")  # µm
    expect(page.get_by_text("regime:")).to_have_count(0)
    served.process.wait(PATIENCE)
    assert "Traceback" not in "".join(served.said)
    with Recording(tmp_path / "bag") as recording:
        applied = recording.applied_disturbances.force
    assert applied.max() == 250.0
    assert applied[-1] == 0.0


CROSSED = """() => {
    const series = window.getElement(stickslip.map).chart?.getOption()?.series ?? [];
    const points = (name) => series.filter((one) => one.name === name).flatMap((one) => one.data);
    const [gains] = points("gains in use");
    const [limit] = points("limit of stability")
        .sort((a, b) => Math.abs(a[0] - gains[0]) - Math.abs(b[0] - gains[0]));
    return limit ? gains[1] < limit[1] : null;
}"""
"""Whether the gains lie below the limit in the map, where they suppress a vibration."""


def accessibility(page: Page) -> list[str]:
    """Return what axe finds against WCAG 2.2 AA and good practice."""
    rules = ["wcag2a", "wcag2aa", "wcag21aa", "wcag22aa", "best-practice"]
    found = Axe().run(page, options={"runOnly": rules}).response["violations"]
    nodes = [(each["id"], each["nodes"][0]) for each in found]
    return [f"{name}: {node['html']} {node['failureSummary']}" for name, node in nodes]


def test_what_an_engineer_does(start_stickslip: Start, page: Page, tmp_path: Path) -> None:
    command = (
        *SLOW,
        *("-p", "plant.belt_speed=0.05", "-p", "washout_controller.linear_gain=-1000"),
    )
    served = Served(start_stickslip(*command))
    page.goto(served.url)
    control = page.get_by_role("switch", name="washout controller")
    expect(control).to_be_checked()
    control.click()
    expect(events(page).get_by_text(SWITCHED_OFF)).to_be_visible()
    wait_for(
        lambda: page.evaluate(CROSSED) is True, "at this belt speed the gains suppress a vibration"
    )

    # The belt speed is lowered by its slider until the slide vibrates.
    slider = page.get_by_role("slider", name="belt speed")
    width, facts = slider.bounding_box()["width"], page.get_by_text(re.compile("^t ="))
    slider.hover(position={"x": 8.0 + (width - 16.0) * 40.0 / 125.0, "y": 8.0})  # of 125 mm/s
    page.mouse.down()
    expect(facts).not_to_have_text(facts.inner_text())  # it stays while the page changes
    page.mouse.up()
    expect(events(page).get_by_text("plant.belt_speed: 50 mm/s to 40 mm/s")).to_be_visible()
    page.get_by_role("button", name="Reset").click()
    expect(page.get_by_text("stick-slip", exact=True).first).to_be_visible()
    wait_for(lambda: page.evaluate(CROSSED) is False, "the gains come to lie on the unstable side")
    wait_for(lambda: swing(page) > 500.0, "the vibration is drawn")
    page.get_by_role("button", name="Store A").click()
    wait_for(lambda: "A" in page.evaluate(LOOK)["legend"], "A is drawn")

    gain = page.get_by_label("linear gain, value")
    gain.fill("-3")  # kN s/m
    gain.press("Enter")
    wait_for(lambda: page.evaluate(CROSSED) is True, "more gain is on the stable side")
    page.get_by_text("200 periods").click()
    page.wait_for_function("stickslip.motion.window > 12")  # s: a period takes 63 ms
    control.click()
    expect(page.get_by_text("steady sliding", exact=True).first).to_be_visible()

    # Before and after are in the window of 200 periods, and in its samples.
    page.get_by_role("button", name="Pause view").click()
    page.get_by_role("button", name="Store B").click()
    assert swing(page) > 500.0
    page.get_by_text("10 periods", exact=True).click()  # for when the view continues
    gain.fill("-2")  # is not of what is shown
    gain.press("Enter")
    expect(events(page).get_by_text("linear_gain: -3 kN s/m to -2 kN s/m")).to_be_visible()
    assert page.evaluate(LOOK)["marks"]
    row = page.get_by_role("row").filter(has=page.get_by_text("regime", exact=True))
    expect(row).to_contain_text("stick-slip")
    expect(row).to_contain_text("steady sliding")
    assert accessibility(page) == []
    time_plots = page.locator(".chart.tall")

    def told() -> str:
        """Values at the pointer; a chart that is drawn meanwhile tells none until it moves."""
        for x in (300, 301):
            time_plots.hover(position={"x": x, "y": 100})
        return time_plots.text_content() or ""

    values = re.compile(r"\S+ s\D.* µm\D.* mm/s\D.* N")
    wait_for(lambda: values.fullmatch(told()) is not None, "values at the pointer are told")
    with page.expect_download() as download:
        page.get_by_role("button", name="CSV").click()
    rows = np.genfromtxt(download.value.path(), delimiter=",", names=True)
    assert 1e6 * np.ptp(rows["position"]) == pytest.approx(swing(page), rel=1e-5)
    with page.expect_download() as picture:
        page.get_by_role("button", name="PNG").click()
    assert picture.value.path().stat().st_size > 10_000
    named = r"bag_belt_speed_[\d.]+_mm_s_.*_linear_gain_-3_kN_s_m_.*_control_on_20.*Z\."
    assert re.fullmatch(named + "png", picture.value.suggested_filename)

    assert served.end() == 130
    expect(page.get_by_role("heading", name="Run ended")).to_be_visible()
    expect(page.get_by_text(f"Recorded in {tmp_path / 'bag'}", exact=True)).to_be_visible()
    again = shlex.join(["stickslip", *command[:3], *command[5:]])  # into a new bag
    assert page.title().startswith(f"{again}, belt speed ")
    assert again in page.locator(".commands:visible").inner_text().splitlines()
    with page.expect_download() as samples:  # although the server has ended
        page.get_by_role("button", name="CSV").click()
    assert re.fullmatch(named + "csv", samples.value.suggested_filename)
    with page.expect_download() as bag:  # although the server has ended
        page.get_by_role("link", name="Download the bag").click()
    written = next((tmp_path / "bag").glob("*.mcap"))
    assert bag.value.path().read_bytes() == written.read_bytes()
    assert accessibility(page) == []
    # All that is shown stays as it is when the system changes to dark.
    page.emulate_media(color_scheme="dark")
    wait_for(lambda: page.evaluate(LOOK)["darkMode"], "the chart is dark")
    assert page.evaluate(LOOK)["label"] == "displacement (µm)"
    assert page.evaluate(FRICTION) == pytest.approx(-40.0)  # mm/s
    assert last_amplitude(page) < math.inf
    assert "Traceback" not in "".join(served.said)


def test_a_page_that_comes_and_goes_changes_nothing(
    start_stickslip: Start, browser: Browser, tmp_path: Path
) -> None:
    command = ("run", "paper", "--pace", "lockstep")
    alone = start_stickslip(*command, "--composed", "--duration", "20", "--bag", "alone")
    assert alone.wait(PATIENCE) == 0
    served = Served(start_stickslip("dashboard"))
    first = new_page(browser)
    first.goto(served.url)
    # It runs until both pages have seen it: a short run may end before a busy machine shows it.
    watched = start_stickslip(*command, "--duration", "1e5", "--bag", "watched")
    first.wait_for_function("stickslip.motion?.end > 1")
    first.close()
    second = new_page(browser)
    second.goto(served.url)
    second.wait_for_function("stickslip.motion?.end > 21")
    second.close()
    watched.send_signal(signal.SIGINT)
    assert watched.wait(PATIENCE) == 130
    assert served.end() == 130
    with Recording(tmp_path / "alone") as one, Recording(tmp_path / "watched") as other:
        for kind in ("joint_states", "control_forces"):
            columns, others = getattr(one, kind), getattr(other, kind)
            for name in vars(columns):
                values = getattr(columns, name)
                common = getattr(others, name)[: len(values)]
                assert np.array_equal(values, common, equal_nan=True), (kind, name)


def test_a_page_of_no_run_and_of_a_node_that_dies_and_returns(
    start_stickslip: Start,
    page: Page,
    processes: Processes,  # noqa: F811
) -> None:
    drive = {"pace": "realtime", "rate": 200.0}
    served = Served(start_stickslip("dashboard", "--namespace", "/test"))
    page.set_viewport_size({"width": 1030, "height": 800})
    page.emulate_media(color_scheme="dark")
    page.goto(served.url)
    expect(page.get_by_text("No drive is running in /test")).to_be_visible()
    expect(page.get_by_text("stickslip run feed_drive --namespace /test")).to_be_visible()
    assert accessibility(page) == []
    plant = processes.node("plant", **drive)
    expect(page.get_by_text("plant active")).to_be_visible()
    expect(page.get_by_role("switch", name="washout controller")).to_be_disabled()
    expect(events(page).get_by_text("no control force arrives").first).to_be_visible()
    page.get_by_role("button", name="Store A").click()
    plant.kill()
    expect(page.get_by_text("plant silent").first).to_be_visible()
    expect(page.get_by_role("button", name="Use A")).to_be_enabled()
    processes.node("plant", **drive, expects_control=False, mass=2.0)
    expect(page.get_by_text(re.compile("plant is back"))).to_be_visible()
    before = page.evaluate("stickslip.motion.end")
    page.wait_for_function("before => stickslip.motion.end !== before", arg=before)
    expect(page.get_by_role("button", name="Use A")).to_be_disabled()  # it has no units
    assert served.end() == 130
    assert "Traceback" not in "".join(served.said)


def test_only_pages_of_this_machine_by_its_own_names_are_answered(
    start_stickslip: Start, page: Page
) -> None:
    served = Served(start_stickslip("dashboard", "--namespace", "/test"))
    address = served.url.removeprefix("http://").split(":")
    wait_for(lambda: _status(served.url) == 200, "the page")
    assert _status(served.url, Host="evil.example") == 400
    frames = served.url.replace("http", "ws") + "/frames"
    assert _websocket_opens(page, frames) is False
    page.goto(served.url)
    assert _websocket_opens(page, frames) is True
    with urllib.request.urlopen(served.url) as response:
        policy = response.headers["Content-Security-Policy"].split("; ")
        assert "frame-ancestors 'none'" in policy
        assert response.headers["X-Content-Type-Options"] == "nosniff"
    socket_io = f"{served.url}/_nicegui_ws/socket.io/?EIO=4&transport=polling"
    assert _status(socket_io, Origin=served.url) == 200
    assert _status(socket_io, Origin="http://evil.example") == 400
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for other in others - {address[0]}:
        with socket.socket() as stranger:
            assert stranger.connect_ex((other, int(address[1]))) != 0
    taken = start_stickslip("dashboard", "--port", address[1])
    _, said = taken.communicate(timeout=PATIENCE)
    assert taken.returncode == 2
    assert f"--port {address[1]}: Address already in use" in said
    assert "Traceback" not in said


def _websocket_opens(page: Page, url: str) -> bool:
    return page.evaluate(
        """url => new Promise((resolve) => {
            const socket = new WebSocket(url);
            socket.onopen = () => resolve(true);
            socket.onerror = () => resolve(false);
        })""",
        url,
    )


def _status(url: str, **headers: str) -> int:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as response:
            return response.status
    except urllib.error.HTTPError as error:
        return error.code
    except urllib.error.URLError:
        return 0
