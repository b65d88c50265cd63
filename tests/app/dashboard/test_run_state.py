"""What is known of a run, from what its nodes tell."""

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from stickslip_ros.app.dashboard.run_state import RunState

CONTROLLER = "washout_controller"


def status(**figures: str) -> DiagnosticStatus:
    """Return the diagnostics of a node, with a level that ROS does not have."""
    values = [KeyValue(key=key, value=value) for key, value in figures.items()]
    return DiagnosticStatus(values=values, level=b"\xff")


def test_any_number_in_diagnostics_is_accepted() -> None:
    run = RunState("/test")
    run.parameters = {**run.parameters, "plant": {"rate": 1e-6}}
    for number in ("٣", "²", "abc", "nan", "-1", "9" * 400, "9" * 5000, ""):
        for node in ("plant", CONTROLLER, "plant", CONTROLLER):
            run.take_status(node, status(answered=number, samples=number, late_forces=number))
        assert run.acts_in == 0.0
        assert run.health["plant"].figures["samples"] == number


def test_a_controller_that_is_switched_leaves_a_mark_and_may_have_other_parameters() -> None:
    run = RunState("/test")
    assert run.take_status(CONTROLLER, status(state="inactive"))  # heard for the first time
    assert not run.take_status(CONTROLLER, status(state="inactive"))
    assert not run.control_on
    assert run.take_status(CONTROLLER, status(state="active"))
    assert run.control_on
    assert run.take_status(CONTROLLER, status(state="inactive"))
    assert [event.mark for event in run.events] == ["", "control on", "control off"]


def test_a_counter_that_starts_again_is_that_of_another_node() -> None:
    run = RunState("/test")
    run.take_status("plant", status(state="active", samples="150"))
    assert not run.take_status("plant", status(state="active", samples="160"))
    assert run.take_status("plant", status(state="active", samples="3"))
    assert [event.text for event in run.events] == ["plant active", "plant restarted"]
