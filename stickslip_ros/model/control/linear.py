"""The linear form of a law, from the law itself: what it answers to each unit alone."""

from dataclasses import replace
from math import inf

import numpy as np

from stickslip_ros.model.control.base import ControlLaw, LinearFeedback
from stickslip_ros.samples import NO_REFERENCE, Sample


def superposed(law: ControlLaw, period: float) -> LinearFeedback:
    """Return the linear form, without limit and reference, of a law.

    Force and next state must be linear in state, displacement and velocity while the force is not
    limited; `period` is that of the samples, s.
    """
    free, states = replace(law, force_limit=inf), len(law.state_units)
    columns: list[list[float]] = []
    for unit in np.eye(states + 2).tolist():
        position, velocity = unit[states:]
        sample = Sample(0, position, velocity, 0.0, 0.0, 0.0)
        force, state = free.respond(tuple(unit[:states]), period, sample, NO_REFERENCE)
        columns.append([*state, force])
    matrix = np.array(columns).T
    return LinearFeedback(
        matrix[:-1, :states], matrix[:-1, states:], matrix[-1, :states], matrix[-1, states:]
    )
