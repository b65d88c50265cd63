import os
import subprocess
import sys
import zipfile
from email.parser import Parser
from importlib import metadata
from pathlib import Path

import ament_index_python
import pytest
from packaging.requirements import Requirement

from tests.docs.shell import OURS, copy_checkout

pytestmark = pytest.mark.long

NAME = "stickslip_ros"
SCRIPTS = metadata.distribution(NAME).entry_points.select(group="console_scripts")
EXECUTABLES = {script.name for script in SCRIPTS}

IMPORT_ALL = """
import importlib, pkgutil, stickslip_ros
from importlib import metadata

LEFT_OUT = {left_out}
for module in pkgutil.walk_packages(stickslip_ros.__path__, "stickslip_ros."):
    if not module.name.startswith(LEFT_OUT):
        importlib.import_module(module.name)
for script in metadata.distribution("stickslip_ros").entry_points.select(group="console_scripts"):
    assert callable(script.load())
"""


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of what git has or would take, so that no build touches the original."""
    copy = tmp_path_factory.mktemp("workspace") / NAME
    copy_checkout(copy)
    return copy


@pytest.fixture(scope="module")
def wheel(checkout, tmp_path_factory):
    """The package as a wheel."""
    folder = tmp_path_factory.mktemp("wheel")
    pip = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--wheel-dir", folder, checkout], check=True)
    (wheel,) = folder.iterdir()
    return wheel


@pytest.fixture
def content(wheel):
    with zipfile.ZipFile(wheel) as opened:
        yield opened


@pytest.fixture
def header(content, stem):
    return Parser().parsestr(content.read(f"{stem}.dist-info/METADATA").decode())


@pytest.fixture
def stem(wheel):
    """Start of the names of the wheel's own folders: name and version."""
    return "-".join(wheel.name.split("-")[:2])


def test_holds_every_file_of_the_package(content, checkout):
    files = [file for file in (checkout / NAME).rglob("*") if file.is_file()]
    expected = {
        str(file.relative_to(checkout)) for file in files if file.parent.name != "__pycache__"
    }
    assert f"{NAME}/py.typed" in expected
    assert {name for name in content.namelist() if name.startswith(f"{NAME}/")} == expected


def test_holds_what_ros_looks_for(content, stem, checkout):
    data = f"{stem}.data/data"
    configuration = {f"share/{NAME}/config/{file.name}" for file in checkout.glob("config/*")}
    stubs = {f"lib/{NAME}/{executable}" for executable in EXECUTABLES}
    index = {f"share/ament_index/resource_index/packages/{NAME}", f"share/{NAME}/package.xml"}
    index |= {f"share/{NAME}/hook/path.dsv"}
    files = [entry for entry in content.namelist() if entry.startswith(data)]
    assert {file.removeprefix(f"{data}/") for file in files} == configuration | stubs | index
    for stub in stubs:
        assert content.getinfo(f"{data}/{stub}").external_attr >> 16 & 0o111 == 0o111


def distributions(requirements, extras):
    """Installed packages that pip would install for these."""
    found = {}
    waiting = [(requirements, extras)]
    while waiting:
        requirements, extras = waiting.pop()
        for requirement in map(Requirement, requirements):
            marker = requirement.marker
            key = requirement.name, frozenset(requirement.extras)
            if key not in found and (
                marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras))
            ):
                found[key] = metadata.distribution(requirement.name)
                waiting.append((found[key].requires or [], requirement.extras))
    return found.values()


def link(distribution, prefix):
    """Make what is installed here be installed there, too."""
    for file in distribution.files:
        # A directory of site-packages belongs to one distribution.
        entry = file if file.parts[0] == ".." else file.parts[0]
        path = Path(os.path.normpath(distribution.locate_file(entry))).relative_to(sys.prefix)
        there = prefix / path
        used = path.parts[0] in ("lib", "share") and path.name != "__pycache__"
        if used and not there.is_symlink():
            there.parent.mkdir(parents=True, exist_ok=True)
            there.symlink_to(sys.prefix / path)


def check_executable(executable, environment, folder):
    """Start it so that it ends by itself: a node by a typo, the script by --help."""
    node = executable.name.endswith("_node")
    arguments = ["--ros-args", "-p", "no_such_parameter:=1"] if node else ["--help"]
    ended = subprocess.run(
        [executable, *arguments], env=environment, cwd=folder, capture_output=True, text=True
    )
    if node:
        assert ended.returncode == 2, ended.stderr
        (line,) = ended.stderr.splitlines()
        assert "no_such_parameter" in line
    else:
        assert ended.returncode == 0, ended.stderr
        assert ended.stdout.startswith(f"usage: {executable.name}")


def test_runs_in_a_new_environment(wheel, header, tmp_path, monkeypatch):
    """With nothing but what it asks for: no tool of ours stands in for a missing dependency."""
    environment = {name: value for name, value in os.environ.items() if name not in OURS}
    environment["PIP_COMPILE"] = "0"
    prefix = tmp_path / "prefix"
    bare = [sys.executable, "-m", "venv", "--without-pip", prefix]
    subprocess.run(bare, env=environment, check=True)
    python = prefix / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python]

    def import_with(*extras, left_out=()):
        for distribution in distributions(header.get_all("Requires-Dist"), extras):
            link(distribution, prefix)
        subprocess.run([*pip, "check"], env=environment, check=True)
        program = IMPORT_ALL.format(left_out=("stickslip_ros.pytest_plugin", *left_out))
        subprocess.run([python, "-c", program], cwd=tmp_path, env=environment, check=True)

    subprocess.run([*pip, "install", "--quiet", "--no-deps", wheel], env=environment, check=True)
    import_with("ros", left_out=["stickslip_ros.app.dashboard."])

    # As `ros2 run` does: the ament index gives the prefix, lib/<package> the files.
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix))
    folder = Path(ament_index_python.get_packages_with_prefixes()[NAME], "lib", NAME)
    found = [file for file in folder.iterdir() if os.access(file, os.X_OK)]
    assert {file.name for file in found} == EXECUTABLES
    assert len({file.read_bytes() for file in found}) == 1  # so that two of them stand for all
    for executable in ("plant_node", "stickslip"):
        ament = environment | {"AMENT_PREFIX_PATH": str(prefix)}
        check_executable(folder / executable, ament, tmp_path)

    import_with("ros", "dashboard")
