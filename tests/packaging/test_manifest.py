from importlib import metadata
from pathlib import Path

import catkin_pkg.package
import pytest
from packaging.requirements import Requirement

PACKAGE = "stickslip_ros"
SOURCE = Path(__file__).parents[2]

KEYLESS = "axe-playwright-python contourpy control distributed heyoka ipykernel lz4 markdown-it-py"
KEYLESS += " mcap nbclient nicegui npTDMS pyarrow shtab xarray zstandard"
# What package.xml calls what setup.py names: rosdep keys, where there are any.
KEYS = {name: set[str]() for name in KEYLESS.split()} | {
    "fastapi": {"python3-fastapi"},
    "jinja2": {"python3-jinja2"},
    "h5py": {"python3-h5py"},
    "hypothesis": {"python3-hypothesis"},
    "jsonschema": {"python3-jsonschema"},
    "matplotlib": {"python3-matplotlib"},
    "numpy": {"python3-numpy"},
    "openpyxl": {"python3-openpyxl"},
    "orjson": {"python3-orjson"},
    "pandas": {"python3-pandas"},
    "pillow": {"python3-pil"},
    "pint": {"python3-pint"},
    "playwright": {"chromium-browser"},  # what it drives; itself it has no key
    "pytest": {"python3-pytest"},
    "pytest-timeout": {"python3-pytest-timeout"},
    "pyyaml": {"python3-yaml"},
    "rich": {"python3-rich"},
    "ros-jazzy-common-interfaces": {
        *("diagnostic_msgs", "geometry_msgs", "sensor_msgs", "std_msgs", "std_srvs")
    },
    "ros-jazzy-rclpy": {
        *("ament_index_python", "builtin_interfaces", "lifecycle_msgs", "rcl_interfaces"),
        *("rclpy", "rosgraph_msgs"),
    },
    "rosbags": {"python3-rosbags-pip"},
    "scipy": {"python3-scipy"},
    "setuptools": {"python3-setuptools"},
    "typing_extensions": {"python3-typing-extensions"},
    "uvicorn": {"python3-uvicorn"},
}


@pytest.fixture
def manifest():
    """package.xml, which catkin_pkg refuses where it is not valid."""
    return catkin_pkg.package.parse_package(SOURCE)


def required(extra):
    """Requirements of setup.py with an extra ("" for none): names on PyPI."""
    requirements = [Requirement(text) for text in metadata.requires(PACKAGE)]
    chosen = f'extra == "{extra}"' if extra else "None"
    return {each.name for each in requirements if str(each.marker) == chosen}


def test_both_ask_for_the_same_to_run(manifest):
    named = required("") | required("ros")
    keys = set().union(*(KEYS[name] for name in named))
    assert {each.name for each in manifest.exec_depends} == keys


def test_both_ask_for_the_same_to_test(manifest):
    keys = set().union(*(KEYS[name] for name in required("test")))
    assert {each.name for each in manifest.test_depends} == keys


def test_the_manifest_tells_what_has_no_key():
    text = " ".join((SOURCE / "package.xml").read_text().split()).replace("[python]", "")
    for extra, sentence in {
        "": "for want of a rosdep key: {keyless}.",
        "dask": "to test them: {keyless}.",
        "dashboard": "For the dashboard: {keys}, and {last} from PyPI;",
        "analysis": "For to_xarray and to_control: {last} from PyPI.",
        "matlab": "For MAT files of version 7.3: {keys}.",
        "formats": "For recordings of other tools: {keys}, and {last} from PyPI.",
    }.items():
        names = required(extra)
        keys = sorted({key for name in names for key in KEYS[name]})
        keyless = sorted(name for name in names if not KEYS[name])
        lists = {"keys": ", ".join(keys), "keyless": ", ".join(keyless)}
        assert sentence.format(**lists, last=" and ".join(keyless)) in text
    site = ", ".join(sorted(required("docs"), key=str.lower))
    assert f"from PyPI: {site}." in text


def test_the_docs_install_in_a_workspace_all_that_is_asked_for():
    requirements = [Requirement(text) for text in metadata.requires(PACKAGE)]
    line = (SOURCE / "docs" / "installing.md").read_text().split("--ignore-installed ")[1]
    written = line.splitlines()[0].replace("'", "").split()
    assert {str(each) for each in requirements if not each.marker} == set(written)
