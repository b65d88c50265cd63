"""Invalid input is refused in one line, with status 2, and leaves nothing behind."""

import os
import shlex
from collections.abc import Mapping
from contextlib import chdir
from pathlib import Path
from threading import TIMEOUT_MAX

import numpy as np
import pytest

from stickslip_ros.app import output
from stickslip_ros.app.main import main
from tests.app.conftest import Run
from tests.record.runs import STAMPS, record

TWO = "has sections for the controllers washout_controller and velocity_feedback_controller: name "
PLACE = "exists already; it is not overwritten"
COLUMNS = "time=t,position=x,force=u"
LOG = f"log.csv --columns {COLUMNS}"
LOOSE = "feed_drive -p plant.stiffness=0"
SPEEDS = "paper --no-control --over plant.belt_speed=0.2:0.6:5"
PAIRS = "log.csv --columns velocity=x,force=u"
WASHOUT = "feed_drive --controllers washout"
FAST = "a belt speed of 30 m/s is refused: more than 10 times 0.1 m/s ... add --yes"
LAW = "feed_drive -p plant.friction.law="

REFUSED: Mapping[str, Mapping[str, str]] = {
    "simulate": {
        "": "the following arguments are required: SCENARIO",
        "nosuch": "unknown scenario 'nosuch' ... axis, ball_screw, feed_drive, ",
        "two.yaml": TWO,
        "paper --duration nan": "'nan' is not a time in seconds, 0 or more",
        # No option: a negative number.
        "paper --duration -.5": "'-.5' is not a time in seconds, 0 or more",
        "paper --durations=3": "--durations=3; did you mean --duration?",
        "paper --controller damper.py": "--controller: damper.py is invalid: must be the name of a",
        "paper --duration 1e9 --plot run.jpg": "--plot run.jpg: must end in one of .png",
        "paper --size 6x4": "--size 6x4: needs --plot FILE, which is not given",
        "paper --out run.txt": "--out run.txt: must end in .csv",
        "paper --html page.txt": "must end in",
        "paper --html no/page.html": "there is no directory",
        "feed_drive -p plant.belt_speed=-30": FAST,
        "feed_drive -p plant.belt.kind=sine -p plant.belt.amplitude=29.96": FAST,
        "paper --duration 1e9 --out there.csv": f"--out there.csv: {PLACE}",
        "paper --out none/run.csv": "--out none/run.csv: there is no directory none",
        "feed_drive --out run.csv --every 0.0015": (
            "--every 0.0015: must be a multiple of the sample period, 0.001 s"
        ),
        f"{LOOSE}": "plant.duration = inf s is invalid: must be finite and above 0 s",
        "paper --continuous-control -p plant.force_delay=0.1": (
            "--continuous-control ... plant.force_delay ... 0.1"
        ),
        f"{LAW}lugre -p plant.friction.curve=dahl": "'dahl' is invalid: law dahl has a memory",
        f"{LAW}lugre -p plant.friction.curve=linear": "must be at least 1e-12 at every speed",
        f"{LAW}dahl -p plant.friction.static=0": "must be at least 1e-12 for law dahl",
    },
    "run": {
        "./nosuch.yaml": "no scenario file ./nosuch.yaml",
        "paper --namespace 'a b'": "--namespace 'a b'",
        f"paper --namespace {230 * 'n'}": "has 231 characters, and must have at most 200",
        "paper --bag .": "exists already",
        "paper --controller stickslip/x": "no package stickslip ... mean stickslip_ros?",
        "paper --controller nosuch/x": "no package nosuch in ... AMENT_PREFIX_PATH",
        "paper --controller stickslip_ros/damper": "no executable damper ... plant_node, ",
        "paper --controller stickslip_ros/washout_controller": (
            "no executable washout_controller; ... did you mean washout_controller_node?"
        ),
        "paper --controller missing.py": "--controller missing.py: there is no such file",
        "paper --controller a/b/missing.py": "a/b/missing.py: there is no such file",
        "paper --external-controller -p plant.expects_control=false": (
            "plant.expects_control = False ... --external-controller"
        ),
        "paper -- -p gain:=3": "-- -p gain:=3 ... --controller",
        "paper --controller velocity_feedback -- --ros-args": (
            "-- --ros-args: arguments after -- are for a script or executable of --controller, "
            "and velocity_feedback is a control law"
        ),
        "paper --pace slow": "invalid choice: 'slow'",
        "paper --controller a/b --external-controller": "not allowed with argument --controller",
        "paper --dashbord": "--dashbord; did you mean --dashboard?",
    },
    "report": {
        "nosuch": "the bag nosuch does not exist",
        ".": ".mcap",
        "none.csv": "No such file",
        "bag --from 50": "bag holds no samples from 50 s on",
        "bag --columns time=t,position=x": "a bag has no columns",
        "bag --stick-speed -1": "is not a speed in m/s, 0 or more",
        "bag --slips 1e-4 --slip-time 0": "within = 0.0 is invalid: must be above 0 (s)",
        "log.csv --columns time=time,time=t": "each quantity once",
        "log.csv --force-constant 0.35Nm/A": "--force-constant 0.35Nm/A: is for the current in a",
        "a b c d e f g --plot out.png": "draws at most 6 bags, and 7 were given",
        "bag --plot out.gif": "must end in one of .png",
        "bag --plot pipe.png": "--plot pipe.png: cannot be written",  # nobody reads it
        "bag --plot out.png --size 6": "'6' is not WIDTHxHEIGHT in inches, each from 2 to 50",
        "bag --plot out.png --size 2x2": "--size 2x2: is too small for this figure",
        "bag --plot out.png --dpi 0": "'0' is not a whole number of dots per inch from 20 to 600",
        "bag --plot out.png --size 50x50 --dpi 600": "50x50 --dpi 600: would be 9e+08 pixels",
        "bag --no-title": "--no-title: needs --plot FILE, which is not given",
    },
    "repair": {"bag": "OUT", "bag bag": "exists already", "bag text/out": "not a directory"},
    "replay": {
        "nosuch": "nosuch ... does not exist",
        "bag --start 10": "start = 10.0 s ... 9.99 s long",
        "bag --topics /x /y": "topics = ['/x', '/y'] ... /feed_drive/joint_states",
        "--topics /x bag": "BAG",
    },
    "sweep": {
        "paper --over belt_speed=1:2:3": "belt_speed: must be a parameter of plant or washout",
        "feed_drive --over plant.belt_speed=2:30:20": FAST,
        f"{SPEEDS} --colour amplitude": "is for maps, of two parameters",
        f"{SPEEDS} --out table.txt": "--out table.txt: must end in one of .csv, .json",
        f"{SPEEDS} --out there.csv": f"--out there.csv: {PLACE}",
        f"{SPEEDS} --plot diagram.jpg": "--plot diagram.jpg: must end in one of",
        f"{SPEEDS} --workers 0": "'0' is not a number of processes",
        f"{SPEEDS} --dask nowhere": "--dask nowhere: no scheduler found",
        f"{SPEEDS} --dask ???": "--dask ???: ",
        f"{LOOSE} --over plant.damping=1:2:2": (
            "because a drive without a spring has no natural period"
        ),
    },
    "basin": {
        "axis": "without a spring no range of starts follows from the drive",
        "paper --seed 1": "--seed 1: is for a random --sample",
        "paper --plot basin.txt": "--plot basin.txt: must end in one of",
    },
    "stability": {
        "axis": "needs a spring: the drive has stiffness = 0 N/m",
        "paper --plot map.txt": "--plot map.txt ... .png",
        "paper --plot map.png -p plant.belt_speed=0.0": "map.png ... the belt rests",
        "paper --plot map.png --no-control -p plant.friction.reverse.static=0.5": (
            "map.png ... nothing to draw ... the same in both directions"
        ),
        "paper --plot /proc/map.png": "/proc/map.png ... cannot be written",
    },
    "design": {
        "feed_drive --belt-speed 2:30": FAST,
        "feed_drive --belt-speed slow": "--belt-speed = 'slow' ... a number in m/s",
        "feed_drive --belt-speed 1:2:3": "--belt-speed '1:2:3' ... LOW:HIGH",
        "feed_drive --no-control": "plant.expects_control",
        "feed_drive --out there.csv": PLACE,
        "feed_drive --out /proc/gains.yaml": "--out /proc/gains.yaml: cannot be written",
    },
    "compare": {
        "feed_drive --controllers washuot": "did you mean washout?",
        f"{WASHOUT} --disturbances bump": "disturbance bump: must be none",
        f"{WASHOUT} --over plant.mas=1:2:3": "did you mean plant.mass",
        f"{WASHOUT} --out cases.txt": "must end in one of .csv, .json",
    },
    "identify": {
        "none.csv": "the file cannot be read",
        "log.csv": "say what they are",
        f"heading.csv --columns {COLUMNS}": "the file cannot be read: it has no rows",
        f"text.csv --columns {COLUMNS}": "text.csv: no row has a time and a position, x",
        PAIRS: "pairs of velocity and force are read by identify --map",
        "log.csv --map": "no column is given for velocity and force",
        f"{PAIRS} --map --fix plant.mass=3": "--fix: a map has friction only",
        f"{PAIRS} --map --check log.csv": "--check: a map has friction only",
        f"{PAIRS} --map --out x.yaml": "--out: a map has friction only",
        f"{LOG} --fix mass=3": "did you mean plant.mass? must be",
        f"{LOG} --from 99": "from 99 s on: it lasts 0.999 s",
        f"{LOG} --out a.txt": "must end in .yaml",
        f"{LOG} --out kept.yaml": PLACE,
    },
    "show": {"papr": "did you mean paper?", "two.yaml": TWO},
    "new": {
        "kept.yaml": f"FILE kept.yaml: {PLACE}",
        "mine.txt": "mine.txt: must end in .yaml or .yml",
    },
    "set": {
        "plant.mas=1": "did you mean plant.mass?",
        "plant.mass=1 --namespace 'a b'": "--namespace 'a b'",
    },
    "dashboard": {"--port 0": "'0' is not a port, 1 to 65535"},
    "simulat": {"": "'simulat'; did you mean simulate?"},
    "version": {"": "'version'; did you mean --version?"},
    "--verson": {"": "'--verson'; did you mean --version?"},
    "--simulate": {"": "'--simulate'; did you mean simulate?"},
}
"""Message of each refused call; ` ... ` stands for any text."""


@pytest.fixture
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files that the refused calls name; no line of progress, however slow the machine is."""
    monkeypatch.setattr(output, "_LINE_INTERVAL", TIMEOUT_MAX)
    record(tmp_path / "bag", STAMPS[::333])
    (tmp_path / "empty").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    time = 1e-3 * np.arange(1000)
    log = np.column_stack([time, np.sin(30.0 * time), np.cos(30.0 * time)])
    np.savetxt(tmp_path / "log.csv", log, delimiter=",", header="t,x,u", comments="")
    for name, text in {
        "text": "these are not the bytes of a bag",
        "kept.yaml": "kept",
        "there.csv": "",
        "heading.csv": "t,x,u\n",
        "text.csv": "t,x,u\n" + "".join(f"{1e-3 * number},on,1\n" for number in range(600)),
        "two.yaml": "/**/washout_controller: {ros__parameters: {linear_gain: -2.0}}\n"
        "/**/velocity_feedback_controller: {ros__parameters: {velocity_gain: -0.5}}\n",
    }.items():
        (tmp_path / name).write_text(text)


@pytest.mark.usefixtures("inputs")
@pytest.mark.parametrize("command", REFUSED)
def test_one_line_and_status_2(stickslip: Run, tmp_path: Path, command: str) -> None:
    before = contents(tmp_path)
    for arguments, message in REFUSED[command].items():
        done = stickslip(command, *shlex.split(arguments))
        assert (done.returncode, done.stdout) == (2, ""), arguments
        *before_it, line = done.stderr.splitlines()
        assert not before_it or before_it[0].startswith("usage: stickslip"), done.stderr
        assert all(part in line for part in message.split(" ... ")), (arguments, line)
    assert contents(tmp_path) == before


def contents(directory: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() if path.is_file() else b"" for path in directory.rglob("*")}


def test_a_fast_belt_that_is_meant_is_taken(stickslip: Run) -> None:
    for scenario in (
        "feed_drive -p plant.belt_speed=1",
        "feed_drive -p plant.belt_speed=30 --yes",
        "feed_drive -p plant.belt_speed=30 -p plant.friction.minimum_speed=3",
        "paper -p plant.belt_speed=10",
    ):
        done = stickslip("simulate", *scenario.split(), "--no-control", "--duration", "0.1")
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("command", ["run paper", "replay bag"])
def test_an_impossible_domain_is_refused(
    stickslip: Run, process_environment: dict[str, str], command: str
) -> None:
    for given, shown in (("here", "'here'"), ("-1", "'-1'"), ("010", "'010'"), ("233", "233")):
        process_environment["ROS_DOMAIN_ID"] = given
        done = stickslip(*command.split())
        assert done.returncode == 2
        refusal = f"ROS_DOMAIN_ID = {shown} is invalid: must be an integer from 0 to 232"
        assert refusal in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("command", "status", "named"),
    [
        ("run paper", 2, "the bag bags/paper-"),
        ("simulate paper --duration 1 --plot x.png", 1, "simulate: "),
        ("design paper --belt-speed 0.2 --out x.yaml", 1, "design: "),
    ],
)
def test_a_current_directory_that_was_deleted_is_named(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], command: str, status: int, named: str
) -> None:
    deleted = tmp_path / "deleted"
    deleted.mkdir()
    with chdir(deleted):
        deleted.rmdir()
        with pytest.raises(SystemExit) as ended:
            main(command.split())
    assert ended.value.code == status
    (line,) = capfd.readouterr().err.splitlines()
    assert named in line
    assert "the current directory has been deleted" in line
