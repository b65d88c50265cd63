"""Sweeps: what a scenario settles on over the values of one parameter or two."""

from collections.abc import Sequence

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.plan import Axis, Carry, Grid
from stickslip_ros.studies.settling import SettlingCourse
from stickslip_ros.studies.study import Study


def sweep_study(
    scenario: Scenario,
    axes: Sequence[Axis],
    *,
    carry: Carry | None = None,
    course: SettlingCourse | None = None,
    continuous: bool = False,
) -> Study:
    """Return the study of what a scenario settles on at each combination of the axes' values.

    From its initial state, or carried on from neighbour to neighbour along the last axis. Control
    is sampled as between the nodes, or `continuous` (eq. 19); without control it is
    `plant.expects_control` that is false. Raises InvalidInputError for what cannot be.
    """
    if not 1 <= len(axes) <= 2:
        raise InvalidInputError(f"{len(axes)} parameters: a sweep is over one or two")
    without = [axis for axis in axes if axis.parameter.startswith("washout_controller.")]
    if without and not scenario.plant.expects_control:
        raise InvalidInputError(f"{without[0]}: without control there is no controller")
    study = Study(scenario, Grid(tuple(axes), carry), course or SettlingCourse(), continuous)
    study.check()
    return study
