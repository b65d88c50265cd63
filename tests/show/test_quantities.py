"""Labels and units of axes."""

from dataclasses import replace

import numpy as np

from stickslip_ros.show.quantities import Units
from tests.drives import FEED_DRIVE, PAPER

SI = Units.for_drive(FEED_DRIVE)


def test_si_has_the_prefix_that_suits() -> None:
    for name, unit, largest, scale, label in (
        ("displacement", "m", 4.3e-4, 1e-6, "displacement (µm)"),
        ("velocity", "m/s", 0.04, 1e-3, "velocity (mm/s)"),
        ("force", "N", 1200.0, 1e3, "force (kN)"),
        ("force", "N", 0.0, 1.0, "force (N)"),
        ("stick fraction", "", 0.3, 1.0, "stick fraction"),
        ("time", "s", 3600.0, 1.0, "time (s)"),
        ("time", "s", 0.02, 1e-3, "time (ms)"),
    ):
        values = np.array([0.0, np.nan, -largest])
        assert SI.axis(name, unit, values, np.empty(0)) == (scale, label)


def test_the_unit_drive_is_dimensionless() -> None:
    units = Units.for_drive(PAPER)
    for name, unit, largest in (("displacement", "m", 1e-5), ("time", "s", 1e-3)):
        assert units.axis(name, unit, [largest]) == (1.0, f"{name} (dimensionless)")
    assert units.axis("stick fraction", "", [0.1])[1] == "stick fraction"
    assert units.text(0.43408, "m") == "0.4341"
    assert units.texts([0.43408, 1e-6, None], "m") == ["0.4341", "1e-06", "-"]
    assert SI.text(4.3408e-4, "m") == "434.1 µm"


def test_a_study_that_varies_one_of_its_scales_is_in_si() -> None:
    assert Units.for_drive(PAPER, ["plant.belt_speed"]).dimensionless
    assert not Units.for_drive(PAPER, ["plant.belt_speed", "plant.mass"]).dimensionless


def test_a_drive_that_differs_in_one_scale_is_not() -> None:
    for other in ("mass", "stiffness", "normal_force"):
        assert not Units.for_drive(replace(PAPER, **{other: 2.0})).dimensionless
    assert not Units.for_drive(None).dimensionless


def test_a_unit_with_a_prefix_of_its_own_gets_no_other() -> None:
    assert SI.text(0.027, "kg") == "0.027 kg"
    assert SI.text(2000.0, "kg") == "2000 kg"
    for unit in ("kg", "kg/s", "1/s", "1/(m s)", "m^2"):
        assert SI.text(2000.0, unit) == f"2000 {unit}"
        assert SI.axis("quantity", unit, [2000.0]) == (1.0, f"quantity ({unit})")
    assert SI.text(2000.0, "N/(m s)") == "2 kN/(m s)"


def test_what_is_infinite_is_unbounded() -> None:
    assert SI.texts([0.002, float("inf")], "m") == ["2 mm", "unbounded"]


def test_names_in_text_have_their_symbols_and_no_formula() -> None:
    assert SI.plain("washout_controller.linear_gain") == "linear gain k1"
    assert SI.plain("friction coefficient") == "friction coefficient μ"
    assert SI.plain("plant.belt_speed") == "belt speed v"
    assert Units(dimensionless=True).plain("plant.belt_speed") == "belt speed v0"
    assert Units(dimensionless=True).plain("plant.damping") == "damping 2β"
    assert SI.plain("stick fraction") == "stick fraction"


def test_a_rotary_axis_has_angles_and_torques() -> None:
    units = Units(rotary=True)
    assert units.texts([0.0025], "m") == ["2.5 mrad"]
    assert units.texts([0.25], "N") == ["250 mN m"]
    assert units.texts([20.0], "kg") == ["20 kg m^2"]
    assert units.texts([4.0], "s") == ["4 s"]
    assert units.axis("displacement", "m", [0.0025]) == (1e-3, "displacement (mrad)")


def test_digits_of_a_value_follow_its_error() -> None:
    assert SI.with_error(299.96, 0.0898, "N") == "299.960 ± 0.090 N"
    assert SI.with_error(-306.2, 19.44, "N") == "-306 ± 19 N"
    assert SI.with_error(4.41e-5, 8.01e-8, "m/s") == "44.100 ± 0.080 µm/s"
    for error in (0.0, 1e-14, float("nan")):  # as of what is given
        assert SI.with_error(300.0, error, "N") == "300 N"
    assert SI.with_error(float("nan"), 0.1, "N") == "-"
