"""Invalid input is refused in one line, with status 2, and leaves nothing behind."""

import socket
from collections.abc import Sequence
from contextlib import ExitStack, chdir
from datetime import UTC, datetime
from pathlib import Path

import pytest

from stickslip_ros.app.main import main
from stickslip_ros.nodes.base.machine_check import port
from tests.app.conftest import Run


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (
            ("simulate", "nosuch"),
            ("unknown scenario 'nosuch'", "axis, feed_drive, feed_profile, paper"),
        ),
        (("run", "./nosuch.yaml"), ("no scenario file ./nosuch.yaml",)),
        (("simulate", "feed_driv"), ("unknown scenario 'feed_driv'", "did you mean feed_drive?")),
        (("simulate", "papre.yaml"), ("no scenario file papre.yaml", "did you mean paper?")),
        (("run", "paper", "-p", "plantt.mass=1"), ("unknown node plantt", "did you mean plant?")),
        (("run", "paper", "-p", "plant.masss=1"), ("parameter masss", "did you mean plant.mass?")),
        (("simulate", "paper", "-p", "plant.mass=heavy"), ("plant: mass = 'heavy'", "number")),
        (
            ("run", "paper", "-p", "plant.mass=-1"),
            ("paper.yaml", "mass = -1", "must be a finite number above 0 kg"),
        ),
        (("run", "paper", "-p", "plant.belt_speed=.nan"), ("belt_speed = nan", "finite")),
        (("run", "paper", "-p", "plant.mass"), ("NODE.PARAMETER=VALUE",)),
        (("run", "paper", "--namespace", "a b"), ("--namespace 'a b'",)),
        (
            ("run", "paper", "--namespace", 230 * "n"),
            ("has 231 characters, and must have at most 200",),
        ),
        (("run", "paper", "--bag", "/proc/none/bag"), ("/proc/none/bag",)),
        (("run", "paper", "--bag", "."), ("exists already",)),
        (
            ("run", "paper", "--controller", "damper"),
            ("--controller: unknown control law damper", "known names are washout, "),
        ),
        (
            ("run", "paper", "--controller", "stickslip/x"),
            ("no package stickslip", "mean stickslip_ros?"),
        ),
        (
            ("run", "paper", "--controller", "nosuch/x"),
            ("no package nosuch in", "AMENT_PREFIX_PATH"),
        ),
        (
            ("run", "paper", "--controller", "stickslip_ros/damper"),
            ("no executable damper", "plant_node, replay_node"),
        ),
        (
            ("run", "paper", "--controller", "stickslip_ros/washout_controller"),
            ("no executable washout_controller;", "did you mean washout_controller_node?"),
        ),
        (
            ("run", "paper", "--external-controller", "-p", "plant.expects_control=false"),
            ("plant.expects_control = False", "--external-controller"),
        ),
        (("run", "paper", "--", "-p", "gain:=3"), ("-- -p gain:=3", "--controller")),
        (("report", "nosuch"), ("nosuch",)),
        (("report", "."), (".mcap",)),
        (
            ("simulate", "paper", "--continuous-control", "-p", "plant.force_delay=0.1"),
            ("--continuous-control", "plant.force_delay", "0.1"),
        ),
        (
            ("simulate", "paper", "--continuous-control", "-p", "plant.force_jitter=0.1"),
            ("--continuous-control", "plant.force_jitter", "0.1"),
        ),
    ],
)
def test_one_line_and_status_2(
    stickslip: Run, tmp_path: Path, arguments: tuple[str, ...], named: tuple[str, ...]
) -> None:
    done = stickslip(*arguments)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    for text in named:
        assert text in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("nosuch",),
        ("simulate",),
        ("simulate", "paper", "--duration", "-1"),
        ("simulate", "paper", "--duration", "nan"),
        ("run", "paper", "--pace", "slow"),
        ("run", "paper", "--no-control", "--external-controller"),
        ("run", "paper", "--controller", "a/b", "--external-controller"),
        ("report", "bag", "--from", "x"),
    ],
)
def test_a_wrong_call_shows_the_usage(stickslip: Run, arguments: tuple[str, ...]) -> None:
    done = stickslip(*arguments)
    assert done.returncode == 2
    assert "usage: stickslip" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("value", ["-2", "-.5", "-1e-3", "-inf"])
def test_a_negative_number_is_a_value_and_no_option(stickslip: Run, value: str) -> None:
    done = stickslip("simulate", "paper", "--duration", value)
    assert done.returncode == 2
    assert f"{value!r} is not a time in seconds, 0 or more" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (("simulat", "paper"), "'simulat'; did you mean simulate?"),
        (("simulate", "paper", "--durations=3"), "--durations=3; did you mean --duration?"),
        (("run", "paper", "--dashbord"), "--dashbord; did you mean --dashboard?"),
    ],
)
def test_a_misspelt_command_or_option_is_guessed(
    stickslip: Run, arguments: tuple[str, ...], meant: str
) -> None:
    done = stickslip(*arguments)
    assert done.returncode == 2
    assert done.stderr.endswith(f"{meant}\n")


def test_a_name_with_its_ending_finds_what_ships(stickslip: Run) -> None:
    done = stickslip("simulate", "feed_drive.yaml", "--duration", "0.1", "--json")
    assert '"name": "feed_drive"' in done.stdout


def test_an_existing_bag_is_left_as_it_is(stickslip: Run, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "precious").write_text("data")
    done = stickslip("run", "paper", "--bag", "bag", "--duration", "1")
    assert done.returncode == 2
    assert "exists already" in done.stderr
    assert [file.name for file in tmp_path.rglob("*")] == ["bag", "precious"]


@pytest.mark.parametrize("arguments", [("run", "paper"), ("replay", "bag")])
@pytest.mark.parametrize(
    ("given", "refusal"),
    [
        (text, f"ROS_DOMAIN_ID = {text!r} is refused: must be an integer from 0 to 232")
        for text in ("here", "-1", "1.5", "010", "5x")
    ]
    + [("233", "ROS_DOMAIN_ID = 233 is refused: must be an integer from 0 to 232")],
)
def test_an_impossible_domain_is_refused(
    stickslip: Run,
    process_environment: dict[str, str],
    arguments: tuple[str, ...],
    given: str,
    refusal: str,
) -> None:
    process_environment["ROS_DOMAIN_ID"] = given
    done = stickslip(*arguments)
    assert done.returncode == 2
    assert refusal in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("numbers", "named"),
    [
        ([0], "UDP port {0}, by which the nodes of ROS_DOMAIN_ID = {domain} find each other, is"),
        (range(10, 210), "of its UDP ports, {0} to {1}, a node needs two that are free"),
    ],
)
def test_a_domain_whose_ports_are_taken_is_refused(
    stickslip: Run, process_environment: dict[str, str], numbers: Sequence[int], named: str
) -> None:
    domain = int(process_environment["ROS_DOMAIN_ID"])
    ports = [port(domain, number) for number in numbers]
    with ExitStack() as held:
        for taken in ports:
            held.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)).bind(("", taken))
        done = stickslip("run", "paper", "--duration", "1")
    assert done.returncode == 2
    assert named.format(ports[0], ports[-1], domain=domain) in done.stderr.splitlines()[-1]


def test_full_shared_memory_is_reported(
    stickslip: Run, process_environment: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stickslip_ros.nodes.base.machine_check.free_shared_memory", lambda: 4096)
    process_environment["FASTDDS_BUILTIN_TRANSPORTS"] = "DEFAULT"
    done = stickslip("run", "paper", "--duration", "1")
    assert done.returncode == 2
    assert "/dev/shm has 4096 bytes free, less than 1048576" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("year", [1969, 2039])
def test_a_clock_that_no_stamp_can_hold_is_refused(
    stickslip: Run, monkeypatch: pytest.MonkeyPatch, year: int
) -> None:
    now = int(datetime(year, 7, 1, tzinfo=UTC).timestamp()) * 1_000_000_000
    monkeypatch.setattr("time.time_ns", lambda: now)
    done = stickslip("run", "paper", "--duration", "1")
    assert done.returncode == 2
    assert f"the clock of this machine shows the year {year}: " in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("arguments", "status", "named"),
    [
        (("run", "paper"), 2, "the bag bags/paper-"),
        (("simulate", "paper", "--duration", "1", "--plot", "x.png"), 1, "simulate: "),
        (("design", "paper", "--belt-speed", "0.2", "--out", "x.yaml"), 1, "design: "),
    ],
)
def test_a_current_directory_that_was_deleted_is_named(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    status: int,
    named: str,
) -> None:
    deleted = tmp_path / "deleted"
    deleted.mkdir()
    with chdir(deleted):
        deleted.rmdir()
        with pytest.raises(SystemExit) as ended:
            main(arguments)
    assert ended.value.code == status
    (line,) = capfd.readouterr().err.splitlines()
    assert named in line
    assert "the current directory has been deleted" in line
