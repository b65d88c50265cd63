"""What the analyzer says of a motion while it is recorded."""

from dataclasses import replace

import pytest

from stickslip_ros.measures.cycle_measures import Cycle, Regime, without_cycles
from stickslip_ros.nodes.analyzing.live_measures import LiveMeasures
from stickslip_ros.nodes.base.managed import DroppedMessages
from stickslip_ros.scenarios.parameters import AnalyzerParameters


@pytest.mark.parametrize(
    ("regime", "share", "end"),
    [(Regime.STICK_SLIP, 0.25, "stick fraction 0.25"), (None, None, "stick fraction not known")],
)
def test_the_text_has_what_is_known(
    regime: Regime | None, share: float | None, end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    cycle = without_cycles(Cycle(1e-3, 0.1, 0.0, 0.0, 0.0, 0.0), regime, 4)
    found = replace(cycle, period=0.5, frequency=2.0, stick_fraction=share)
    live = LiveMeasures(AnalyzerParameters(), DroppedMessages.__new__(DroppedMessages))
    monkeypatch.setattr(live.meter.motion, "measures", lambda *, quick: found)
    live.cycles = 4
    name = "stick_slip" if regime else "regime not known"
    assert live.text() == f"{name}: amplitude 1 mm, frequency 2 Hz, {end}"
