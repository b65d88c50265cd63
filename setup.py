from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.install_scripts import install_scripts

MANIFEST = ElementTree.parse("package.xml").getroot()
NAME = MANIFEST.findtext("name")

EXECUTABLES = {
    "plant_node": "stickslip_ros.nodes.plant:main",
    "controller_node": "stickslip_ros.nodes.controller:main",
    "washout_controller_node": "stickslip_ros.nodes.washout_controller:main",
    "analyzer_node": "stickslip_ros.nodes.analyzer:main",
    "replay_node": "stickslip_ros.nodes.replay:main",
    "stickslip": "stickslip_ros.app.main:main",
}

ANALYSIS = ["control>=0.10.1", "xarray>=2024.6"]  # control: the first for numpy 2
MATLAB = ["h5py>=3.11"]  # the first built for numpy 2
FORMATS = [
    "npTDMS>=1.9",  # the first for numpy 2
    "openpyxl>=3.1",  # the oldest that pandas takes
    "pyarrow>=16.1",  # the first built for numpy 2
    "rosbags",
]
DASHBOARD = ["contourpy", "fastapi", "nicegui>=3", "orjson", "uvicorn"]

STUB = '#!/bin/sh\nexec "$(dirname "$0")/../../bin/$(basename "$0")" "$@"\n'


class InstallScripts(install_scripts):
    """Gives a wheel what ``ros2 run`` looks for: ``lib/<package>/<executable>``.

    colcon has the scripts written there (setup.cfg). A wheel leaves them to pip, which writes them
    into ``bin/``; so it carries a stub for each, which hands over to its namesake there.
    """

    def run(self):
        """Install the scripts, or the stubs for them where the entry points are left to pip."""
        super().run()
        if not self.no_ep:
            return
        folder = Path(self.get_finalized_command("install").install_data, "lib", NAME)
        folder.mkdir(parents=True)
        for executable in EXECUTABLES:
            stub = folder / executable
            stub.write_text(STUB)
            stub.chmod(0o755)


setup(
    name=NAME,
    version=MANIFEST.findtext("version"),
    description=MANIFEST.findtext("description"),
    maintainer=MANIFEST.findtext("maintainer"),
    maintainer_email=MANIFEST.find("maintainer").get("email"),
    license=MANIFEST.findtext("license"),
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        NAME: [
            "py.typed",
            "api/*.html",
            "app/completion.*sh",
            "app/dashboard/*.css",
            "app/dashboard/*.js",
            "nodes/base/*.xml",
            "show/*.jinja",
            "show/*.mplstyle",
        ]
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(glob("config/*"))),
        (f"share/{NAME}/hook", ["resource/path.dsv"]),  # `stickslip` in a sourced workspace
    ],
    entry_points={
        "console_scripts": [f"{name} = {function}" for name, function in EXECUTABLES.items()],
        "pytest11": [f"{NAME} = {NAME}.pytest_plugin"],
    },
    cmdclass={"install_scripts": InstallScripts},
    zip_safe=False,
    python_requires=">=3.11",
    # Each from the oldest that continuous integration runs the tests with, on Python 3.12.
    install_requires=[
        "heyoka>=7.10.1",  # the oldest wheels for Python 3.11 to 3.13; it asks for numpy 2
        "jinja2>=3.1.6",  # the oldest that NiceGUI takes
        "lz4>=4.3.3",  # the oldest wheels for 3.12
        "matplotlib>=3.8.4",  # the first built for numpy 2
        "mcap>=1.5",  # the first whose writer can close a chunk on demand
        "numpy>=2",
        "pandas>=2.2.2",  # the first built for numpy 2
        "pillow>=10.1",  # the oldest wheels for 3.12
        "pint>=0.24.4",  # the first that works with the flexparser of today
        "pyyaml>=6.0.1",  # the first that builds with the Cython of today
        "rich>=13",
        "scipy>=1.13",  # the first built for numpy 2
        "shtab>=1.11",  # the first that completes directories
        "typing_extensions>=4.10",  # the oldest that starlette takes; 3.11 has no `override`
        "zstandard>=0.22",  # the oldest wheels for 3.12
    ],
    extras_require={
        # Results as data sets and systems (to_xarray, to_control).
        "analysis": ANALYSIS,
        # MAT files of version 7.3.
        "matlab": MATLAB,
        # Recordings in the formats of other tools: Excel, Parquet, TDMS, sqlite3, ROS 1.
        "formats": FORMATS,
        # A web page that shows a run (stickslip dashboard); all but NiceGUI are what it stands on.
        "dashboard": DASHBOARD,
        # Studies on a cluster (stickslip sweep --dask).
        "dask": ["distributed>=2024.2.1"],
        # ROS itself, where none is installed; the message packages come with these two.
        "ros": ["ros-jazzy-common-interfaces", "ros-jazzy-rclpy[fastrtps]"],
        "test": [
            *ANALYSIS,
            *DASHBOARD,
            *MATLAB,
            *FORMATS,
            "axe-playwright-python",  # checks the dashboard for accessibility
            "distributed",
            "hypothesis",
            "ipykernel",  # runs the notebooks of examples/, with nbclient
            "jsonschema",  # checks scenarios with the schema that editors use
            "markdown-it-py",  # finds the blocks of code in the docs
            "nbclient",
            "playwright",  # drives the browser of the system: no download of its own
            "pytest",
            "pytest-timeout",
            "setuptools>=70.1",  # the first to make wheels unaided
        ],
        # The documentation as a web site (make site).
        "docs": [
            "griffe-inherited-docstrings",  # overrides without a docstring
            "latex2mathml",  # formulas that need no script in the browser
            "mkdocs-material",
            "mkdocs>=1.6",  # the first that checks the anchors of links
            "mkdocstrings[python]",
            "pymdown-extensions",
            "ruff",  # breaks the lines of signatures
        ],
        "dev": [
            "colcon-common-extensions",
            "colcon-core>=0.20",  # the first that says which setuptools it works with
            "colcon-ros",
            "psutil",  # processor time of a dashboard and its browser (make bench)
            "pyright[nodejs]",  # with a Node.js that is quicker than those of most machines
            "pytest-xdist",
            "ruff",
        ],
    },
)
