"""Sweeps: the settled motion of a scenario over the values of one or two parameters."""

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
    """Return the study of a scenario over the values of one or two parameters.

    Compute it with `compute_columns` or `run`. For a sweep without control, set
    `plant.expects_control` to false in the scenario.

    Parameters
    ----------
    scenario : Scenario
        The scenario; it supplies all other parameters.
    axes : Sequence[Axis]
        One or two axes; the study has every combination of their values.
    carry : Carry, optional
        Direction along the last axis in which each point starts from the end of its neighbour. By
        default every point starts in the scenario's initial state.
    course : SettlingCourse, optional
        How long each motion is simulated; by default a transient of 200 natural periods, then 4
        cycles.
    continuous : bool
        Whether the control acts without sampling (eq. 19).

    Returns
    -------
    Study
        The study, ready to be computed.

    Raises
    ------
    InvalidInputError
        If there are not one or two axes, an axis is of a controller that the scenario does not
        have, or no point is valid.

    Examples
    --------
    >>> from stickslip_ros.scenarios.files import load_scenario
    >>> from stickslip_ros.studies.plan import Axis
    >>> study = sweep_study(load_scenario("paper"), [Axis("plant.belt_speed", 0.1, 0.5, 5)])
    >>> study.plan.size
    5
    """
    if not 1 <= len(axes) <= 2:
        raise InvalidInputError(f"{len(axes)} parameters: a sweep is over one or two")
    without = [axis for axis in axes if not axis.parameter.startswith("plant.")]
    if without and not scenario.plant.expects_control:
        raise InvalidInputError(f"{without[0]}: without control there is no controller")
    study = Study(scenario, Grid(tuple(axes), carry), course or SettlingCourse(), continuous)
    study.check()
    return study
