import subprocess
import sys
import zipfile
from email.parser import Parser

import pytest

pytestmark = pytest.mark.long

IMPORT_ALL = """
import importlib, pkgutil, stickslip_ros

LEFT_OUT = {left_out}
for module in pkgutil.walk_packages(stickslip_ros.__path__, "stickslip_ros."):
    if not module.name.startswith(LEFT_OUT):
        importlib.import_module(module.name)
"""


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
def stem(wheel):
    """What the wheel's own folders begin with: name and version."""
    return "-".join(wheel.name.split("-")[:2])


def test_holds_every_file_of_the_package(content, checkout):
    files = [file for file in (checkout / checkout.name).rglob("*") if file.is_file()]
    expected = {
        str(file.relative_to(checkout)) for file in files if file.parent.name != "__pycache__"
    }
    assert f"{checkout.name}/py.typed" in expected
    assert {name for name in content.namelist() if name.startswith(f"{checkout.name}/")} == expected


def test_holds_what_ros_looks_for(content, stem, checkout, executables):
    name = checkout.name
    data = f"{stem}.data/data"
    configuration = {f"share/{name}/config/{file.name}" for file in checkout.glob("config/*")}
    stubs = {f"lib/{name}/{executable}" for executable in executables}
    index = {f"share/ament_index/resource_index/packages/{name}", f"share/{name}/package.xml"}
    files = [entry for entry in content.namelist() if entry.startswith(data)]
    assert {file.removeprefix(f"{data}/") for file in files} == configuration | stubs | index
    for stub in stubs:
        assert content.getinfo(f"{data}/{stub}").external_attr >> 16 & 0o111 == 0o111


def test_names_its_extras(content, stem):
    metadata = Parser().parsestr(content.read(f"{stem}.dist-info/METADATA").decode())
    assert set(metadata.get_all("Provides-Extra")) == {"dashboard", "ros", "dask", "test", "dev"}
    assert metadata["Requires-Python"] == ">=3.11"


def test_runs_in_a_new_environment(
    wheel, tmp_path, environment, executables, find_executables, check_executable
):
    """With nothing but what it asks for: no tool of ours stands in for a missing dependency."""
    prefix = tmp_path / "prefix"
    subprocess.run([sys.executable, "-m", "venv", prefix], env=environment, check=True)
    python = prefix / "bin" / "python"
    pip = [python, "-m", "pip", "install", "--quiet"]
    subprocess.run([*pip, f"{wheel}[ros]"], env=environment, check=True)

    def import_all_but(*left_out):
        program = IMPORT_ALL.format(left_out=("stickslip_ros.pytest_plugin", *left_out))
        subprocess.run([python, "-c", program], cwd=tmp_path, env=environment, check=True)

    import_all_but("stickslip_ros.app.dashboard.")

    found = find_executables(prefix)
    assert found.keys() == executables
    for executable in found.values():
        check_executable(executable, environment | {"AMENT_PREFIX_PATH": str(prefix)})

    subprocess.run([*pip, f"{wheel}[ros,dashboard]"], env=environment, check=True)
    import_all_but()
