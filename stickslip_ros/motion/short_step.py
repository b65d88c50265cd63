"""Short advances of a motion that stay in one phase, as those of a sampled loop mostly do."""

from collections.abc import Callable
from math import inf

import heyoka as hy

from stickslip_ros.model.drive_system import DriveSystem
from stickslip_ros.model.hybrid import Instant, Mode
from stickslip_ros.motion.compiled_flow import CompiledFlow

LONGEST_STEP = 64.0
"""Longest step of an integration: the end of an advance shortens no earlier one."""

_LONGEST_ADVANCE = 1.0
"""Longest advance that counts as short: where it fails, its integration is repeated."""

NO_EVENT = hy.taylor_outcome.time_limit.value
"""Value of the outcome of an integration that has reached its end."""

_STEP_ENDED = hy.taylor_outcome.success.value
"""Value of the outcome of a step that the end of an advance does not shorten."""

STEPS_PER_ADVANCE = 1_000
"""Number of steps that an advance may take, however short: milliseconds of work."""

ShortStep = Callable[[float, float | None], bool]
"""Advances by a duration, under a held force, if it is given, instead of the present one.

Where a guard or a corner is reached, it returns False, and leaves the state as it was.
"""


def short_step(
    system: DriveSystem, mode: Mode, instant: Instant, flow: CompiledFlow | None, corner: float
) -> ShortStep:
    """Return what advances in a mode with this flow, to the same bits as the general case.

    It looks nothing up: between two samples, that takes longer than the integration. A mode ends at
    the time `corner` whatever the state.
    """
    settled, inputs = system.settled, instant.inputs
    raw = (instant.state if flow is None else flow.state.data).cast("B")
    if flow is None:
        closed_form = system.closed_form

        def move(duration: float, force: float | None) -> bool:
            before = raw.tobytes()
            if force is not None:
                inputs[0] = force
            if settled(mode, instant) is mode and closed_form(mode, instant, duration)[0] is None:
                return True
            raw[:] = before
            return False

        return move
    taylor, step, propagate = flow.taylor, flow.taylor.step, flow.taylor.propagate_until
    parameters, epoch = flow.parameters, flow.epoch
    limits_steps, longest_step = system.limits_steps, system.longest_step
    places = [index for number, index in flow.inputs if number == 0]

    def integrate(duration: float, force: float | None) -> bool:
        if duration > _LONGEST_ADVANCE or duration >= corner - instant.time:
            return False
        before = raw.tobytes()
        if force is not None:
            inputs[0] = force
            for index in places:
                parameters[index] = force
        if settled(mode, instant) is mode:
            if epoch is not None:
                parameters[epoch] = instant.time
            taylor.time = 0.0
            longest = longest_step(instant) if limits_steps else inf
            # Mostly one step, which takes less time by itself.
            outcome = step(duration)[0].value if duration <= longest else _STEP_ENDED
            if outcome == _STEP_ENDED:
                outcome = propagate(duration, STEPS_PER_ADVANCE, longest)[0].value
            if outcome == NO_EVENT:
                return True
            taylor.reset_cooldowns()
            flow.take_marks()
        raw[:] = before
        return False

    return integrate
