"""What two seconds of a run in real time say of the rest."""

import pytest

from stickslip_ros.nodes.base.managed import FORECAST
from stickslip_ros.nodes.forecast import Forecast, forecast
from stickslip_ros.nodes.plant import PlantNode
from tests.nodes.graph import Graph


@pytest.mark.parametrize(
    ("waits", "rate", "sentence"),
    [
        ([0.5e-3] * 1000, 1000.0, "1 kHz: about 0 % of the forces will be late"),
        ([0.5e-3] * 995 + [1.0] * 5, 1000.0, "1 kHz: about 0.5 % of the forces will be late"),
        (
            [0.5e-3] * 800 + [2.1e-3] * 195 + [1.0] * 5,
            1000.0,
            "1 kHz: about 20 % of the forces will be late; 400 Hz would do",
        ),
        ([3.0] * 10, 50.0, "50 Hz: about 100 % of the forces will be late; 300 mHz would do"),
    ],
)
def test_the_rate_that_would_do_is_that_at_which_few_forces_would_be_late(
    waits: list[float], rate: float, sentence: str
) -> None:
    assert forecast(waits, rate) == sentence


def test_a_force_ends_the_wait_of_the_samples_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every third sample is answered, half a period after it; the first second is left out."""
    now = 0.0
    monkeypatch.setattr("stickslip_ros.nodes.forecast.time.monotonic", lambda: now)
    expected = forecast([0.025, 0.015, 0.005] * 67, 100.0)
    observed = Forecast(100.0, lambda number: number / 100.0)
    for number in range(0, 303, 3):
        now = (number + 0.5) / 100.0
        assert observed.sentence == ""
        observed.answered(number)
    assert observed.sentence == expected
    assert expected == "100 Hz: about 67 % of the forces will be late; 40 Hz would do"


def test_a_plant_forecasts_a_long_run_and_not_a_short_one(graph: Graph) -> None:
    graph.answer_every_third_sample()
    plant = graph.add(PlantNode, pace="realtime", rate=200.0, wait_for=["observer"], duration=60.5)
    graph.wait_until(lambda: FORECAST in plant.diagnose()[2], "a forecast")
    sentence = plant.diagnose()[2][FORECAST]
    assert sentence.startswith("200 Hz: about ")
    assert float(sentence.split()[3]) > 60.0
    assert sentence.endswith("Hz would do")
