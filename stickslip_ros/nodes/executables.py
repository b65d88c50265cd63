"""What the installed executables of the nodes start."""

from functools import partial
from importlib import import_module

from stickslip_ros.nodes import prepare_process


def _run(node: str) -> None:
    prepare_process()
    import_module(f"stickslip_ros.nodes.{node}").main()


plant = partial(_run, "plant")
washout_controller = partial(_run, "washout_controller")
analyzer = partial(_run, "analyzer")
replay = partial(_run, "replay")
