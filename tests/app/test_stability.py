"""`stickslip stability`: the paper's values, and the reasons for missing values."""

import pytest

from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.stability import stability as theory_of
from stickslip_ros.text import finite
from tests.app.conftest import Run
from tests.theory.closed_forms import CubicLoop


def test_the_papers_drive(stickslip: Run) -> None:
    speed = ("-p", "plant.belt_speed=0.49", "-p", "plant.damping=0.01")
    found = stickslip.json("stability", "paper", *speed)
    open_loop, closed_loop = found["open_loop"], found["closed_loop"]
    real, imaginary = (0.44 - 1.8 * 0.49**2) / 2.0, 0.99999235
    assert open_loop["eigenvalues"][0] == [pytest.approx(real), pytest.approx(imaginary)]
    assert (open_loop["stable"], closed_loop["stable"]) == (False, True)
    assert len(closed_loop["eigenvalues"]) == 3
    (cycle,) = open_loop["limit_cycles"]
    assert (cycle["stable"], cycle["regime"]) == (True, "pure_slip")
    assert found["sampled_loop"]["critical_linear_gain"] == pytest.approx(-0.0396, abs=2e-3)
    assert found["sticking"]["onset_speed"] == pytest.approx(0.44466141)
    scenario = load_scenario("paper", ["plant.belt_speed=0.49", "plant.damping=0.01"])
    cubic, gains = CubicLoop.from_drive(scenario.plant.as_drive()), scenario.control_law
    corner = gains.corner_frequency
    assert found["closed_forms"] == pytest.approx(
        {
            "equilibrium_position": cubic.equilibrium,
            "hopf_speed": cubic.hopf_speed,
            "crossing_speed": cubic.crossing_speed,
            "first_lyapunov_coefficient": cubic.first_lyapunov_coefficient,
            "onset_speed_approximate": cubic.sticking_onset,
            "critical_linear_gain": cubic.critical_linear_gain(corner),
            "critical_lyapunov_coefficient": cubic.critical_lyapunov_coefficient(
                corner, gains.cubic_gain
            ),
            "critical_cubic_gain": cubic.critical_cubic_gain(corner),
        },
        rel=1e-12,
    )
    assert found["notes"].keys() == {"closed_loop.limit_cycles"}
    assert found["scenario"]["plant"]["belt_speed"] == 0.49
    assert found["overrides"] == ["plant.belt_speed=0.49", "plant.damping=0.01"]


@pytest.mark.parametrize(
    "overrides",
    [
        ["plant.friction.law=coulomb"],
        ["plant.friction.law=coulomb", "plant.damping=0.0"],
        ["plant.belt_speed=0.2", "washout_controller.corner_frequency=3.0"],
        ["plant.belt_speed=0.0", "plant.expects_control=false"],
        ["plant.force_delay=5000.0", "plant.damping=2.0"],
    ],
)
def test_what_does_not_exist_is_null_for_a_reason(overrides: list[str]) -> None:
    found, notes = theory_of(load_scenario("paper", overrides))
    # What is said of a Hopf point stands in several lists, one reason for all of them.
    of_hopf = {"hopf_angular_frequencies", "crossing_speeds", "first_lyapunov_coefficients"}
    nulls: list[str] = []
    for section in ("open_loop", "sticking", "closed_loop", "sampled_loop"):
        for name, value in found[section].items():
            if finite(value) in (None, []):
                name = "hopf_speeds" if name in of_hopf else name
                assert f"{section}.{name}" in notes or section in notes, f"{section}.{name}"
                nulls.append(name)
    for name in ("equilibrium_position", "closed_forms"):
        assert (found[name] is None) == (name in notes)
    assert nulls
    assert None not in (found["closed_forms"] or {}).values()


def test_what_is_left_out_is_said_where_it_matters() -> None:
    jitter, encoder = "plant.force_jitter=0.1", "plant.sensor.position_resolution=1e-6"
    without, _ = theory_of(load_scenario("paper"))
    for override in (jitter, encoder):
        with_it, notes = theory_of(load_scenario("paper", [override]))
        assert finite(with_it) == finite(without)
        assert f"{override[6:].split('=')[0]} is omitted" in notes["sampled_loop"]
    assert notes["closed_loop"].startswith("sensor and actuator are omitted")
    _, notes = theory_of(load_scenario("paper", [jitter, "plant.expects_control=false"]))
    assert notes["sampled_loop"] == "the scenario has no controller"
