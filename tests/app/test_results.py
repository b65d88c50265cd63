"""What a command prints, writes and draws is one result, the same as in Python."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import stickslip_ros as ss
from stickslip_ros.api.recordings import Comparison
from stickslip_ros.api.results import Result
from stickslip_ros.errors import RunError
from stickslip_ros.scenarios.files import load_scenario
from tests.app.browser import headless_browser
from tests.app.conftest import REFERENCE, Run
from tests.docs.parsed_html import Html
from tests.docs.test_json import differences

LOG = "log.csv"


def log(folder: Path) -> None:
    """Write a table of a drive without control."""
    drive = ss.scenario("feed_drive", expects_control=False, belt_speed=0.02)
    ss.simulate(drive, duration=0.6).to_pandas().to_csv(folder / LOG)


FREE = ("paper", "--no-control")


def free() -> ss.Scenario:
    return load_scenario("paper", ["plant.expects_control=false"])


KNOWN = {"plant.mass": 100.0, "plant.damping": 200.0}
LAWS = ["washout", "velocity_feedback"]
DISTURBED: dict[str, Any] = {"disturbances": "step", "seeds": 2, "spread": 0.1}

CASES: dict[str, tuple[tuple[str, ...], Callable[[], Result], str]] = {
    "simulate": (
        ("feed_drive", "--duration", "1"),
        lambda: ss.simulate("feed_drive", duration=1.0),
        "434.1 µm",
    ),
    "sweep": (
        (*FREE, "--over", "plant.belt_speed=0.3:0.5:3", "--carry", "both"),
        lambda: ss.sweep(free(), belt_speed=(0.3, 0.5, 3), carry="both"),
        "stick-slip at",
    ),
    "basin": ((*FREE, "--sample", "3"), lambda: ss.basin(free(), sample=3), "stick-slip 100.0%"),
    "stability": (
        ("feed_drive",),
        lambda: ss.stability("feed_drive"),
        "without control: unstable; sampled loop: stable",
    ),
    "design": (
        ("feed_drive", "--belt-speed", "0.06"),
        lambda: ss.design("feed_drive", belt_speed=0.06),
        "linear gain",
    ),
    "identify": (
        (LOG, "--law", "coulomb", *(f"--fix={n}={v}" for n, v in KNOWN.items()), "--check", LOG),
        lambda: ss.identify(LOG, law="coulomb", fixed=KNOWN, check=[LOG]),
        "95 % interval",
    ),
    "compare": (
        (
            "feed_drive",
            *("--controllers", ",".join(LAWS), "--given", "washout", "--duration", "0.6"),
            *("--disturbances", "step", "--seeds", "2", "--spread", "0.1"),
        ),
        lambda: ss.compare("feed_drive", LAWS, given="washout", duration=0.6, **DISTURBED),
        "Comparison of control laws",
    ),
    "report": ((REFERENCE,), lambda: ss.read_bag(REFERENCE), "decaying"),
    "report, of two": (
        (REFERENCE, LOG),
        lambda: Comparison((ss.read_bag(REFERENCE), ss.read_table(LOG))),
        f"{REFERENCE}: at the end: stick-slip, not steady: decaying",
    ),
}
"""The arguments of commands, the same results from Python, and what they say, of a table too."""


def draws_nothing(*_: Any, **__: Any) -> Any:
    raise RunError("it takes too long")


@pytest.mark.parametrize("name", CASES)
def test_a_command_prints_and_a_page_shows_what_python_returns(
    name: str, stickslip: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the schema of docs describes it."""
    arguments, made, verdict = CASES[name]
    if LOG in arguments:
        log(tmp_path)
    command = name.partition(",")[0]
    monkeypatch.chdir(tmp_path)
    result = made()
    printed = stickslip.json(command, *arguments)
    assert printed == result.to_dict()
    schema = "report_of_several_bags" if name == "report, of two" else command
    assert differences(schema, printed) == []
    text = stickslip(command, *arguments).stdout
    assert all(line in text for line in repr(result).splitlines())
    monkeypatch.setattr(type(result), "draw", draws_nothing)
    result.to_html(tmp_path / "page.html")
    found = Html((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert verdict in found.text
    assert "There is no figure: it takes too long" in found.text
    assert "table" in found.tags


def test_a_page_tells_the_force_of_a_disturbance_beside_that_of_the_control(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run = ss.simulate("axis", 1.4)
    monkeypatch.setattr(type(run), "draw", draws_nothing)
    run.to_html(tmp_path / "page.html")
    found = " ".join(Html((tmp_path / "page.html").read_text(encoding="utf-8")).text.split())
    assert "control force and disturbance at most 18.91 N" in found


def test_a_page_is_one_file_whose_identifiers_are_its_own(stickslip: Run, tmp_path: Path) -> None:
    """The name of a scenario is text in it."""
    name = "<script>alert(1)<"
    stickslip("new", "drive.yaml", "--from", "feed_drive")
    (tmp_path / "drive.yaml").rename(tmp_path / f"{name}.yaml")
    done = stickslip("simulate", f"{name}.yaml", "--duration", "1", "--html", "page.html")
    assert done.returncode == 0, done.stderr
    found = Html((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert found.tags.count("svg") == 2
    assert not {"script", "link", "iframe", "object"} & {*found.tags}
    assert len({*found.identifiers}) == len(found.identifiers) > 10
    inside = {f"#{each}" for each in found.identifiers}
    assert {each for each in found.references if not each.startswith("data:")} <= inside
    for text in (name, "stick-slip", "434.1 µm", "friction.static", "N s/m", "heyoka"):
        assert text in found.text
    for text in ("feeds that hold", "27.6 mm/s to 400 mm/s", "linear gain -3 kN s/m"):
        assert text in found.text
    for text in ("friction.kinetic", "reply_timeout", "bias_force", "bag_exists"):  # not used
        assert text not in found.text


@pytest.mark.process
@pytest.mark.long
def test_what_is_above_the_line_of_a_page_prints_on_one_sheet(
    stickslip: Run, tmp_path: Path
) -> None:
    """Of A4, with nothing cut off; what is below starts on the next."""
    laws = "--controllers", ",".join(LAWS), "--given", "washout", "--duration", "0.6"
    compare = ("compare", "feed_drive", *laws, "--seeds", "2", "--spread", "0.1")
    commands = ("simulate", "feed_drive", "--duration", "1"), compare, ("report", REFERENCE)
    with headless_browser() as browser:
        for command in commands:
            assert stickslip(*command, "--html", "page.html").returncode == 0
            page = browser.new_page(viewport={"width": 680, "height": 1009})
            page.goto((tmp_path / "page.html").as_uri())
            count: dict[str, int] = {}
            for hidden in ("nothing", ".details", ".first"):
                style = page.add_style_tag(content=f"{hidden} {{ display: none !important; }}")
                printed = page.pdf(prefer_css_page_size=True)
                count[hidden] = len(re.findall(rb"/Type /Page\b", printed))
                style.evaluate("style => style.remove()")
            assert count[".details"] == 1
            assert count["nothing"] == 1 + count[".first"]
            page.emulate_media(media="print")
            room = "part => [part.clientHeight - part.scrollHeight, innerWidth - part.scrollWidth]"
            for part in (".first", ".details"):
                assert min(page.locator(part).evaluate(room)) >= 0, (command, part)
