"""What a command prints, writes and draws is one result, the same as in Python."""

import json
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

import stickslip_ros as ss
from stickslip_ros.api.recordings import Comparison
from stickslip_ros.api.results import Result
from stickslip_ros.errors import RunError
from stickslip_ros.scenarios.files import load_scenario
from tests.app.conftest import REFERENCE, Run

LOG = "log.csv"


def log(folder: Path) -> str:
    """Write a table of a drive without control, and return its path."""
    drive = ss.scenario("feed_drive", expects_control=False, belt_speed=0.02)
    ss.simulate(drive, duration=1.0).to_pandas().to_csv(folder / LOG)
    return str(folder / LOG)


FREE = ("paper", "--no-control")


def free() -> ss.Scenario:
    return load_scenario("paper", ["plant.expects_control=false"])


KNOWN = {"plant.mass": 100.0, "plant.damping": 200.0}
LAWS = ["washout", "velocity_feedback"]
DISTURBED: dict[str, Any] = {"disturbances": "step", "seeds": 2, "spread": 0.1}
NOISY = "plant.sensor.position_noise=1e-6"

CASES: dict[str, tuple[tuple[str, ...], Callable[[str], Result]]] = {
    "simulate": (
        ("feed_drive", "--duration", "1"),
        lambda _: ss.simulate("feed_drive", duration=1.0),
    ),
    "simulate, with a sensor": (
        ("feed_drive", "-p", NOISY, "--duration", "1"),
        lambda _: ss.simulate(ss.scenario("feed_drive", NOISY), duration=1.0),
    ),
    "sweep": (
        (*FREE, "--over", "plant.belt_speed=0.3:0.5:3", "--carry", "both"),
        lambda _: ss.sweep(free(), belt_speed=(0.3, 0.5, 3), carry="both"),
    ),
    "basin": ((*FREE, "--sample", "3"), lambda _: ss.basin(free(), sample=3)),
    "stability": (("feed_drive",), lambda _: ss.stability("feed_drive")),
    "design": (
        ("feed_drive", "--belt-speed", "0.04"),
        lambda _: ss.design("feed_drive", belt_speed=0.04),
    ),
    "identify": (
        (LOG, "--law", "stribeck", *(f"--fix={n}={v}" for n, v in KNOWN.items()), "--check", LOG),
        lambda log: ss.identify(log, law="stribeck", fixed=KNOWN, check=[log]),
    ),
    "compare": (
        (
            "feed_drive",
            *("--controllers", ",".join(LAWS), "--given", "washout", "--duration", "0.6"),
            *("--disturbances", "step", "--seeds", "2", "--spread", "0.1"),
        ),
        lambda _: ss.compare("feed_drive", LAWS, given="washout", duration=0.6, **DISTURBED),
    ),
    "report": ((REFERENCE,), lambda _: ss.read_bag(REFERENCE)),
    "report, of two": (
        (REFERENCE, LOG),
        lambda log: Comparison((ss.read_bag(REFERENCE), ss.read_table(log))),
    ),
}
"""The arguments of commands, and the same results from Python, with a table if they need one."""


@pytest.mark.parametrize("name", CASES)
def test_a_command_prints_what_python_returns(
    name: str, stickslip: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments, made = CASES[name]
    if LOG in arguments:
        log(tmp_path)
    command = name.partition(",")[0]
    monkeypatch.chdir(tmp_path)
    result = made(LOG)
    printed = stickslip(command, *arguments, "--json").stdout
    assert json.loads(printed) == result.to_dict()
    text = stickslip(command, *arguments).stdout
    assert all(line in text for line in repr(result).splitlines())


class Page(HTMLParser):
    """The tags, identifiers, references and text of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.text = ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]

    def handle_data(self, data: str) -> None:
        self.text += f"{data} "

    @property
    def identifiers(self) -> list[str]:
        return [value for name, value in self.attributes if name == "id"]

    @property
    def references(self) -> list[str]:
        """What links, images, and clipping paths refer to; no namespaces."""
        named = [v for n, v in self.attributes if n in ("href", "xlink:href", "src")]
        return named + [
            found for _, v in self.attributes for found in re.findall(r"url\((.*?)\)", v)
        ]


def page(stickslip: Run, folder: Path, *arguments: str) -> Page:
    done = stickslip(*arguments, "--html", str(folder / "page.html"))
    assert done.returncode == 0, done.stderr
    return Page(folder / "page.html")


def test_a_page_is_one_file_whose_identifiers_are_its_own(stickslip: Run, tmp_path: Path) -> None:
    found = page(stickslip, tmp_path, "simulate", "feed_drive", "--duration", "1")
    assert found.tags.count("svg") == 2
    assert not {"script", "link", "iframe", "object"} & {*found.tags}
    assert len({*found.identifiers}) == len(found.identifiers) > 10
    inside = {f"#{each}" for each in found.identifiers}
    assert {each for each in found.references if not each.startswith("data:")} <= inside
    for text in ("stick-slip", "434.1 µm", "friction.static", "N s/m", "heyoka"):
        assert text in found.text
    assert "friction.kinetic" not in found.text  # of another law


def test_a_name_is_text(stickslip: Run, tmp_path: Path) -> None:
    name = "<script>alert(1)<"
    stickslip("new", "drive.yaml", "--from", "feed_drive")
    (tmp_path / "drive.yaml").rename(tmp_path / f"{name}.yaml")
    found = page(stickslip, tmp_path, "simulate", f"{name}.yaml", "--duration", "1")
    assert "script" not in found.tags
    assert name in found.text


@pytest.mark.parametrize(
    ("name", "verdict"),
    [
        ("design", "linear gain"),
        ("identify", "95 % interval"),
        ("compare", "Comparison of control laws"),
        ("basin", "stick-slip 100.0%"),
        ("stability", "without control: unstable; sampled loop: stable"),
        ("sweep", "stick-slip at"),
        ("report", "decaying"),
        ("report, of two", f"{REFERENCE}: stick-slip, not steady: decaying"),
    ],
)
def test_python_writes_a_page_of_any_result(
    name: str, verdict: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def draw(*_: Any, **__: Any) -> Any:
        raise RunError("it takes too long")

    result = CASES[name][1](log(tmp_path))
    monkeypatch.setattr(type(result), "draw", draw)
    result.to_html(tmp_path / "page.html")
    found = Page(tmp_path / "page.html")
    assert verdict in found.text
    assert "There is none: it takes too long" in found.text
    assert "table" in found.tags


def test_without_a_figure_a_page_says_why(stickslip: Run, tmp_path: Path) -> None:
    limit = ("-p", "washout_controller.force_limit=1")
    found = page(stickslip, tmp_path, "design", "feed_drive", *limit)
    assert "There is none: there is nothing to propose" in found.text
    assert "svg" not in found.tags
