import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

SOURCE = Path(__file__).parents[2]


@pytest.fixture
def set_up(tmp_path):
    """Asks make for an environment made by a given Python."""
    # The make that runs the tests hands its own variables on.
    inherited = {name: value for name, value in os.environ.items() if name != "MAKEFLAGS"}

    def run(python, *arguments, **variables):
        venv = tmp_path / "venv"
        command = ["make", "--silent", f"VENV={venv}", f"PYTHON={python}", *arguments]
        environment = inherited | variables
        return subprocess.run(command, cwd=SOURCE, env=environment, capture_output=True, text=True)

    return run


def script(file, text):
    file.write_text(f"#!/bin/sh\n{text}\n")
    file.chmod(0o755)
    return file


def fake_python(folder, pattern, action):
    """Make a Python of which only this much goes wrong."""
    text = f'case "$*" in {pattern}) {action};; *) exec {sys.executable} "$@";; esac'
    return script(folder / "python3", text)


@pytest.fixture
def log(tmp_path):
    """The file in which the stand-ins write what they are called with."""
    return tmp_path / "log"


@pytest.fixture
def uv(tmp_path, log):
    """A uv that installs nothing."""
    return script(tmp_path / "uv", f'echo "uv $*" $UV_CONSTRAINT $UV_DEFAULT_INDEX >>{log}')


@pytest.fixture
def python(tmp_path, uv, log):
    """A Python that makes environments whose pip installs nothing but uv."""
    template = tmp_path / "template"
    (template / "share" / "ament_index" / "resource_index" / "packages").mkdir(parents=True)
    for folder in ("bin", "lib"):
        (template / folder).mkdir()
    get_uv = f'case "$*" in *pip*" uv") cp {uv} $(dirname $0);; esac'
    script(template / "bin" / "python", f'echo "python $*" >>{log}; {get_uv}')
    venv = tmp_path / "venv"
    return fake_python(tmp_path, "*--clear*", f"rm -rf {venv}; cp -r {template} {venv}")


@pytest.fixture
def installed(log):
    """Who has installed which extras since the last call."""

    def take():
        lines = log.read_text().splitlines() if log.exists() else []
        log.unlink(missing_ok=True)
        calls = [line for line in lines if "--editable" in line]
        return [(line.split()[0], line.partition(".[")[2].partition("]")[0]) for line in calls]

    return take


NEEDED = "ros,dashboard"
ALL = "ros,dashboard,test,dev,docs"


def test_the_demo_waits_for_what_it_needs_and_the_rest_is_added_once(set_up, python, uv, installed):
    for target, expected in (
        ("demo", [("uv", NEEDED)]),
        ("demo", []),
        ("setup", [("uv", ALL)]),
        ("setup", []),
        ("demo", []),
    ):
        assert set_up(python, target, f"UV={uv}").returncode == 0
        assert installed() == expected


@pytest.mark.parametrize("what", ["absent", "unwanted", "broken"])
def test_pip_installs_where_uv_does_not(set_up, python, uv, installed, tmp_path, what):
    if what == "broken":
        script(uv, "exit 2")
    given = {"absent": tmp_path / "nowhere", "unwanted": "", "broken": uv}[what]
    assert set_up(python, "setup", f"UV={given}").returncode == 0
    assert installed() == [("python", NEEDED), ("python", ALL)]


def test_pip_puts_uv_into_the_environment(set_up, python, installed, tmp_path):
    assert set_up(python, "setup", f"UV={tmp_path / 'venv' / 'bin' / 'uv'}").returncode == 0
    assert installed() == [("uv", NEEDED), ("uv", ALL)]


@pytest.mark.parametrize(
    ("variables", "expected"),
    [
        ({}, "of_file http://file"),
        ({"PIP_CONSTRAINT": "of_pip", "PIP_INDEX_URL": "http://pip"}, "of_pip http://pip"),
        ({"UV_CONSTRAINT": "of_uv", "UV_DEFAULT_INDEX": "http://uv"}, "of_uv http://uv"),
    ],
)
def test_uv_takes_the_index_and_the_constraints_of_pip(
    set_up, python, uv, log, tmp_path, variables, expected
):
    settings = tmp_path / "pip" / "pip.conf"
    settings.parent.mkdir()
    settings.write_text("[global]\nconstraint = of_file\nindex-url = http://file\n")
    names = ("PIP_CONFIG_FILE", "PIP_CONSTRAINT", "PIP_INDEX_URL")
    none = dict.fromkeys((*names, "UV_CONSTRAINT", "UV_DEFAULT_INDEX"), "")
    variables = {**none, **variables, "XDG_CONFIG_HOME": str(tmp_path)}
    assert set_up(python, "demo", f"UV={uv}", **variables).returncode == 0
    assert log.read_text().splitlines()[0].endswith(expected)


def test_what_was_interrupted_is_cleared(set_up, python, uv, installed, tmp_path):
    half = tmp_path / "venv" / "half"
    assert set_up(python, "demo", f"UV={uv}").returncode == 0
    script(uv, f"touch {half}; kill $PPID")
    assert set_up(python, "setup", f"UV={uv}").returncode != 0
    assert half.exists()
    installed()
    assert set_up(python, "demo", "UV=").returncode == 0
    assert not half.exists()
    assert installed() == [("python", NEEDED)]


def test_says_in_a_line_what_to_install_where_python_or_venv_is_missing(set_up, tmp_path):
    without_venv = fake_python(tmp_path, "*ensurepip*", "exit 1")
    for python, named in (("false", "install python3 python3-venv"), (without_venv, "-venv")):
        refused = set_up(python)
        assert refused.returncode != 0
        assert named in refused.stderr.splitlines()[0]
