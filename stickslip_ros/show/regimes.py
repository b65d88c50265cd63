"""How regimes look, in figures and on the page, which imports no matplotlib."""

from collections.abc import Mapping
from typing import NamedTuple

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.show import BLUE, GREEN, GREY, LIGHT_GREY, ORANGE, SKY_BLUE, YELLOW


class Look(NamedTuple):
    """Colour and label of a regime, with marker and hatch to distinguish it without colour."""

    colour: str
    label: str
    marker: str
    hatch: str
    """Hatch pattern, drawn in `INK`."""


REGIMES: Mapping[Regime | None, Look] = {
    regime: Look(colour, Regime.label(regime), marker, hatch)
    for regime, colour, marker, hatch in (
        (Regime.STICK_SLIP, ORANGE, "o", ""),
        (Regime.PURE_SLIP, BLUE, "^", "..."),
        (Regime.EQUILIBRIUM, GREEN, "s", "///"),
        (Regime.HELD, SKY_BLUE, "v", "---"),
        (Regime.STUCK, GREY, "D", "xxx"),
        (Regime.UNBOUNDED, "black", "X", ""),
        (Regime.UNDERSAMPLED, YELLOW, "p", "+++"),
        (None, LIGHT_GREY, "P", "\\\\\\"),
    )
}
"""Look by regime; None is for a motion without one."""
