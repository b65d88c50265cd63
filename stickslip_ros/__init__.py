"""Stick-slip vibration of a feed drive: simulated, controlled and measured.

    import stickslip_ros as ss

    run = ss.simulate(ss.scenario("feed_drive", belt_speed=0.03), duration=10)
    run.measures, run.plot(), run.to_pandas()

The names below are loaded when they are first used: importing the package takes a few milliseconds.
"""

import atexit
import gc
import os

from stickslip_ros.interrupts import NODE_SCRIPTS, end_quietly_if_interrupted, is_run

if is_run(__name__, "stickslip", *NODE_SCRIPTS):
    end_quietly_if_interrupted()
    # Small matrices gain nothing from more threads, whose waiting takes processors from the nodes.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # What is imported stays: to look for garbage in it takes an eighth of a short command's time,
    # at its end again.
    gc.set_threshold(20_000)
    atexit.register(gc.freeze)

from typing import TYPE_CHECKING, Any  # what takes time comes second

if TYPE_CHECKING:
    from stickslip_ros.api.comparison import ComparedLaws, compare
    from stickslip_ros.api.design import Proposal, design
    from stickslip_ros.api.friction_map import FrictionMap, friction_map
    from stickslip_ros.api.identification import Model, identify
    from stickslip_ros.api.margin import Margin, margin
    from stickslip_ros.api.recordings import RecordedRun, read_bag, read_table
    from stickslip_ros.api.runs import Run, simulate
    from stickslip_ros.api.scenarios import scenario
    from stickslip_ros.api.studies import Basin, Sweep, basin, sweep
    from stickslip_ros.api.theory import Stability, stability
    from stickslip_ros.errors import StickslipError
    from stickslip_ros.measures.slips import SlipThreshold
    from stickslip_ros.scenarios.files import Scenario

    __version__: str

__all__ = [
    "Basin",
    "ComparedLaws",
    "FrictionMap",
    "Margin",
    "Model",
    "Proposal",
    "RecordedRun",
    "Run",
    "Scenario",
    "SlipThreshold",
    "Stability",
    "StickslipError",
    "Sweep",
    "__version__",
    "basin",
    "compare",
    "design",
    "friction_map",
    "identify",
    "margin",
    "read_bag",
    "read_table",
    "scenario",
    "simulate",
    "stability",
    "sweep",
]

_HOMES = {
    "api.comparison": ("ComparedLaws", "compare"),
    "api.design": ("Proposal", "design"),
    "api.friction_map": ("FrictionMap", "friction_map"),
    "api.identification": ("Model", "identify"),
    "api.margin": ("Margin", "margin"),
    "api.recordings": ("RecordedRun", "read_bag", "read_table"),
    "api.runs": ("Run", "simulate"),
    "api.scenarios": ("scenario",),
    "api.studies": ("Basin", "Sweep", "basin", "sweep"),
    "api.theory": ("Stability", "stability"),
    "errors": ("StickslipError",),
    "measures.slips": ("SlipThreshold",),
    "scenarios.files": ("Scenario",),
}


def __getattr__(name: str) -> Any:
    """Load a public name from its module (PEP 562)."""
    from importlib import import_module

    if name == "__version__":
        from importlib import metadata  # takes as long as the rest of a start

        value: Any = metadata.version(__name__)
    else:
        home = next((module for module, names in _HOMES.items() if name in names), None)
        if home is None:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = getattr(import_module(f"{__name__}.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, those that are not loaded yet included."""
    return sorted(__all__)
