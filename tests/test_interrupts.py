"""Which processes end quietly on SIGINT while they import."""

from importlib import metadata

import stickslip_ros


def test_every_installed_script_is_known() -> None:
    scripts = metadata.distribution("stickslip_ros").entry_points.select(group="console_scripts")
    assert set(stickslip_ros._SCRIPTS) == set(scripts.names)
