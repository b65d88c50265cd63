"""Processes that end quietly on SIGINT while they import."""

from importlib import metadata

from stickslip_ros.interrupts import NODE_SCRIPTS


def test_every_installed_script_is_known() -> None:
    scripts = metadata.distribution("stickslip_ros").entry_points.select(group="console_scripts")
    assert {"stickslip", *NODE_SCRIPTS} == set(scripts.names)
