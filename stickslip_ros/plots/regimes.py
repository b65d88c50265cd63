"""What each regime looks like, and is called, in every picture."""

from collections.abc import Mapping

from stickslip_ros.physics.measures import Regime
from stickslip_ros.plots.style import BLUE, GREEN, GREY, LIGHT_GREY, ORANGE

REGIMES: Mapping[Regime | None, tuple[str, str]] = {
    Regime.STICK_SLIP: (ORANGE, "sticks and slips"),
    Regime.PURE_SLIP: (BLUE, "slips only"),
    Regime.EQUILIBRIUM: (GREEN, "comes to rest"),
    Regime.STUCK: (GREY, "rests with the belt"),
    Regime.UNBOUNDED: ("black", "runs away"),
    None: (LIGHT_GREY, "completes no cycle"),
}
"""Colour and name of each regime."""
