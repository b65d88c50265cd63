"""The stick-slip motion of a drive with a held force or with continuous control."""

from math import copysign, inf, ulp
from typing import ClassVar

import heyoka as hy
import numpy as np

from stickslip_ros.deprecated_names import Renamed
from stickslip_ros.errors import RunError
from stickslip_ros.physics.measures.breakpoints import Breakpoints
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.equations import WashoutGains
from stickslip_ros.physics.motion.integrator import (
    BELT_SPEED_REACHED,
    UNBOUNDED_SPEED,
    UNBOUNDED_SPEED_REACHED,
    Integrator,
    Integrators,
)

_LARGEST_FORCE = 1e100
"""Largest dimensionless force; a larger one is clipped to it: both make the motion unbounded."""

_SPARE_STEPS, _STEPS_PER_RADIAN = 4_000_000, 10_000
"""Integration steps that a motion may take: seconds of work, a thousand times the usual number."""
_STEPS_PER_ADVANCE = 1_000
"""Extra steps for each advance, however short: milliseconds of work."""
_MOST_STEPS = 1e18
"""Largest number of steps that heyoka accepts."""
_STEPS_OF_A_PHASE = 10
"""Number of steps that the work around the integration of one stick or slip is worth."""

_NO_EVENT = hy.taylor_outcome.time_limit.value
_NOT_FINITE = hy.taylor_outcome.err_nf_state.value


class Motion:
    """Motion of a drive: stick, slip and the transitions between them, to machine precision.

    heyoka's adaptive Taylor method integrates the slip and finds the instant at which the slide
    reaches the belt speed. There the slide sticks if friction can hold it, |h| <= mu_s N with the
    reaction h = k x + c v_belt - u; otherwise it passes the belt speed or slips the other way.
    During stick the slide moves with the belt until the reaction exceeds that limit: in a straight
    line while the force is held. With continuous control the filter keeps running, and heyoka
    finds the instant.

    All inputs and outputs are in SI units. You may change drive, force and gains between calls of
    `advance`; the changes take effect from then on.

    Parameters
    ----------
    drive : Drive
        Drive in motion.
    position : float
        Displacement of the slide at the start, m.
    velocity : float
        Velocity of the slide at the start, m/s.
    continuous_control : bool, optional
        Whether the force is that of the washout controller without sampling, eq. 19. Its filter
        starts at rest and its gains at zero (see `set_gains`). By default the force is `force`.
    record : bool, optional
        Whether to record the breakpoints of the motion (see `take_breakpoints`).

    Examples
    --------
    The first millisecond of a slide that starts at rest:

    >>> from stickslip_ros.physics.model.drive import Drive
    >>> from stickslip_ros.physics.model.friction import Stribeck
    >>> from stickslip_ros.physics.motion import Motion
    >>> drive = Drive(mass=100.0, damping=200.0, stiffness=1e6, normal_force=1000.0,
    ...               belt_speed=0.04, friction=Stribeck(0.4, 0.25, 0.05))
    >>> motion = Motion(drive, position=0.0, velocity=0.0)
    >>> motion.advance(0.001)
    >>> round(1e6 * motion.position, 3), motion.sticking
    (1.297, False)
    """

    _with_derivatives: ClassVar[bool] = False
    """Whether the variational equations are integrated, too."""

    def __init__(
        self,
        drive: Drive,
        position: float,
        velocity: float,
        *,
        continuous_control: bool = False,
        record: bool = False,
    ) -> None:
        self.unbounded = False
        """Whether the motion is unbounded; then it does not advance any further."""
        self._recording = record
        self._recorded: list[tuple[float, float, float, bool]] = []
        self._continuous_control = continuous_control
        self._controller = WashoutGains(drive.angular_frequency, 0.0, 0.0)
        self._gains = self._controller.scaled(drive)
        self._force = 0.0
        self._steps_left = _SPARE_STEPS
        self._time = self._breakpoint_time = 0.0
        self._x = self._y = self._w = 0.0
        self._drive = drive
        self._integrators = Integrators(
            continuous_control=continuous_control, with_derivatives=self._with_derivatives
        )
        self._marks = self._integrators.marks
        self._use_law()
        self._set_parameters()
        self.restart(position, velocity)

    def begin(self, drive: Drive, position: float, velocity: float) -> None:
        """Start again with a drive, as a new motion would; only `recording` and the gains are kept.

        Parameters
        ----------
        drive : Drive
            Drive in motion from now on.
        position : float
            Displacement of the slide at the start, m.
        velocity : float
            Velocity of the slide at the start, m/s.
        """
        self.drive = drive
        self.force = 0.0
        self._recorded.clear()
        self._steps_left = _SPARE_STEPS
        self._time = self._breakpoint_time = 0.0
        self.restart(position, velocity)

    def restart(self, position: float, velocity: float) -> None:
        """Set the state of the slide; force and gains are kept, and the filter is at rest.

        Parameters
        ----------
        position : float
            Displacement of the slide, m.
        velocity : float
            Velocity of the slide, m/s.
        """
        drive = self._drive
        self.unbounded = False
        self._x, self._y = position / drive.length_scale, velocity / drive.speed_scale
        self._w = self._y / self._gains.corner_frequency
        self._settle()
        self._append_breakpoint(0.0, self._x, self._y, sticking=False)

    @property
    def drive(self) -> Drive:
        """Drive in motion; a new one keeps the position and velocity of the slide."""
        return self._drive

    @drive.setter
    def drive(self, drive: Drive) -> None:
        old, force = self._drive, self.force
        position, velocity, filter_output = self.position, self.velocity, self._filter_output
        self._drive = drive
        self._use_law()
        if drive.speed_scale != old.speed_scale or drive.length_scale != old.length_scale:
            self._x, self._y = position / drive.length_scale, velocity / drive.speed_scale
        self._scale_controller(filter_output)
        self._set_parameters()
        self.force = force
        self._settle()

    @property
    def recording(self) -> bool:
        """Whether breakpoints are recorded: this costs more than the motion itself."""
        return self._recording

    @recording.setter
    def recording(self, recording: bool) -> None:
        if recording == self._recording:
            return
        parameters = self._slipping.parameters
        self._recording = recording
        self._use_law()
        self._slipping.parameters[:] = parameters
        self._append_breakpoint(0.0, self._x, self._y, sticking=False)

    @property
    def force(self) -> float:
        """Control and disturbance force on the slide, N; held until you set it again."""
        return self._force * self._drive.normal_force

    @force.setter
    def force(self, force: float) -> None:
        scaled = force / self._drive.normal_force
        if not -_LARGEST_FORCE <= scaled <= _LARGEST_FORCE:
            scaled = max(-_LARGEST_FORCE, min(_LARGEST_FORCE, scaled))
        self._force = scaled

    @property
    def applied_force(self) -> float:
        """Present force on the slide, N: the held one, or that of the continuous controller."""
        if self._continuous_control:
            return self._controller.force(self.velocity - self.low_passed)
        return self.force

    def set_gains(self, corner_frequency: float, linear: float, cubic: float) -> None:
        """Set the cutoff frequency and gains of the continuous controller, eq. 17 and 18.

        The output of the filter does not jump when d changes.

        Parameters
        ----------
        corner_frequency : float
            Cutoff frequency d, rad/s.
        linear : float
            Linear gain k1, N s/m.
        cubic : float
            Cubic gain k2, N s^3/m^3.
        """
        filter_output = self._filter_output
        self._controller = WashoutGains(corner_frequency, linear, cubic)
        self._scale_controller(filter_output)
        self._set_parameters()

    @property
    def low_passed(self) -> float:
        """Low-passed speed in the washout filter, d w of eq. 17, m/s."""
        return self._w * self._gains.corner_frequency * self._drive.speed_scale

    @low_passed.setter
    def low_passed(self, low_passed: float) -> None:
        self._w = low_passed / (self._gains.corner_frequency * self._drive.speed_scale)

    @property
    def position(self) -> float:
        """Displacement of the slide, m."""
        return self._x * self._drive.length_scale

    @property
    def velocity(self) -> float:
        """Velocity of the slide, m/s; during stick exactly the belt speed."""
        if self._sign == 0.0:
            return self._drive.belt_speed
        return self._y * self._drive.speed_scale

    @property
    def sticking(self) -> bool:
        """Whether the slide stuck to the belt at the end of the last advance."""
        return self._sign == 0.0

    @property
    def friction_force(self) -> float:
        """Friction force on the slide, N, with the force held so far."""
        if self._sign == 0.0:
            return self._reaction() * self._drive.normal_force
        relative_speed = (self._y - self._belt_speed) * self._drive.speed_scale
        coefficient = self._drive.friction.coefficient(relative_speed, self._sign)
        return float(coefficient) * self._drive.normal_force

    def advance(self, duration: float) -> None:
        """Integrate over a duration, the force held; stop early if the motion becomes unbounded.

        Parameters
        ----------
        duration : float
            Duration, s.

        Raises
        ------
        RunError
            If the motion is so stiff that it would take too many steps.
        """
        if self.unbounded:
            return
        end = duration * self._drive.angular_frequency
        now = 0.0
        # Without `min`: two calls cost a twentieth of a step of the sampled loop.
        if self._steps_left > _SPARE_STEPS:
            self._steps_left = _SPARE_STEPS
        steps = _STEPS_PER_RADIAN * end
        self._steps_left += _STEPS_PER_ADVANCE + int(steps if steps < _MOST_STEPS else _MOST_STEPS)
        self._settle()
        while now < end and not self.unbounded:
            now = self._stick(now, end) if self._sign == 0.0 else self._slip(now, end)
        self._time += duration

    take_knots = Renamed("take_breakpoints")

    def take_breakpoints(self) -> Breakpoints:
        """Return the breakpoints recorded since the last call, and clear them.

        Returns
        -------
        Breakpoints
            Breakpoints in order of time, in SI units; time 0 is the start of the motion.
        """
        if not self._recorded:
            return Breakpoints.empty()
        time, x, y, sticking = zip(*self._recorded, strict=True)
        self._recorded.clear()
        return Breakpoints(
            np.array(time),
            np.array(x) * self._drive.length_scale,
            np.array(y) * self._drive.speed_scale,
            np.array(sticking),
        )

    @property
    def _filter_output(self) -> float:
        """Output of the washout filter, m/s."""
        return self._gains.filtered(self._y, self._w) * self._drive.speed_scale

    def _scale_controller(self, filter_output: float) -> None:
        """Make the controller dimensionless; the output of its filter is `filter_output` (m/s)."""
        self._gains = self._controller.scaled(self._drive)
        filtered = filter_output / self._drive.speed_scale
        self._w = (self._y - filtered) / self._gains.corner_frequency

    def _reaction(self) -> float:
        """Return h = X + 2 beta X' - U, dimensionless."""
        force = self._force
        if self._continuous_control:
            force = self._gains.force(self._gains.filtered(self._y, self._w))
        return self._x + self._damping * self._y - force

    def _settle(self) -> None:
        """Set from speed and reaction whether the slide sticks, or in which direction it slips."""
        relative_speed = self._y - self._belt_speed
        if relative_speed != 0.0:
            self._sign = copysign(1.0, relative_speed)
            self.unbounded = abs(self._y) > UNBOUNDED_SPEED
            return
        reaction = self._reaction()
        self._sign = -copysign(1.0, reaction) if abs(reaction) > self._static else 0.0

    # heyoka misses an event in a step that starts on one. A phase that starts at one of its own
    # limits is therefore started some rounding errors away from it.

    def _stick(self, now: float, end: float) -> float:
        """Move with the belt until the reaction exceeds its limit, or to `end`; return the time."""
        integrator = self._sticking
        if integrator is None:
            breaks, now = self._stick_straight(now, end)
        else:
            reaction = self._reaction()
            margin = self._rounding(reaction)
            if abs(reaction) > self._static - margin:
                self._x -= copysign(margin, reaction)
            integrator.parameters[self._equations.index["force"]] = self._force
            event, now = self._propagate(integrator, now, end)
            breaks = event is not None
        self._y = self._belt_speed
        self._append_breakpoint(now, self._x, self._y, sticking=True)
        if breaks:
            self._sign = -copysign(1.0, self._reaction())
        return now

    def _stick_straight(self, now: float, end: float) -> tuple[bool, float]:
        """Move with the belt, force held; return whether the limit was reached, and the time."""
        speed = self._belt_speed
        if speed != 0.0:
            limit = copysign(self._static, speed) - self._damping * speed + self._force
            time = max((limit - self._x) / speed, 0.0)
            if time < end - now:
                self._x = limit
                return True, now + time
        self._x += speed * (end - now)
        return False, end

    def _slip(self, now: float, end: float) -> float:
        """Slip until the slide reaches the belt speed, or to `end`; return the time."""
        parameters, index = self._slipping.parameters, self._equations.index
        parameters[index["force"]], parameters[index["sign"]] = self._force, self._sign
        if self._y == self._belt_speed:
            reaction = self._reaction()
            margin = self._rounding(reaction)
            if abs(reaction) < self._static + margin:
                self._x -= copysign(margin, self._sign)
            self._y += copysign(max(ulp(self._belt_speed), ulp(1.0)), self._sign)
        event, now = self._propagate(self._slipping, now, end)
        if event == BELT_SPEED_REACHED:
            self._y = self._belt_speed
        if self._recording:
            for instant, x, y in self._marks:
                self._append_breakpoint(instant, x, y, sticking=False)
            self._marks.clear()
            self._append_breakpoint(now, self._x, self._y, sticking=False)
        if event == BELT_SPEED_REACHED:
            self._settle()
        elif event is not None:
            self.unbounded = True
        return now

    def _rounding(self, reaction: float) -> float:
        return 8.0 * ulp(abs(self._x) + abs(reaction) + abs(self._force) + self._static)

    def _propagate(
        self, integrator: Integrator, now: float, end: float
    ) -> tuple[int | None, float]:
        """Integrate the state from `now` to `end`; return the event that ended it, and the time."""
        taylor, variables = integrator.taylor, integrator.variables
        variables[0], variables[1] = self._x, self._y
        if self._continuous_control:
            variables[2] = self._w
        taylor.time = now
        if self._characteristic_speed == inf:
            reached = taylor.propagate_until(end, self._steps_left)
        else:
            reached = taylor.propagate_until(end, self._steps_left, self._longest_step())
        outcome = reached[0].value
        self._steps_left -= reached[3] + _STEPS_OF_A_PHASE
        if outcome == _NOT_FINITE:  # what causes this exceeds any speed immediately
            taylor.reset_cooldowns()
            self._sign = copysign(1.0, -self._reaction())
            self._y = self._sign * UNBOUNDED_SPEED
            return UNBOUNDED_SPEED_REACHED, now
        self._x, self._y = variables[0], variables[1]
        if self._continuous_control:
            self._w = variables[2]
        if outcome == _NO_EVENT:
            return None, end
        if self._steps_left <= 0:
            taylor.reset_cooldowns()
            self._marks.clear()  # of a slip that is not reported
            frequency = self._drive.angular_frequency
            raise RunError(
                "the motion is too stiff to be followed: it takes more than "
                f"{_STEPS_PER_RADIAN} steps of integration for {1.0 / frequency:g} s"
            )
        taylor.reset_cooldowns()  # the next integration is another slip or stick
        return -outcome - 1, float(taylor.time)

    def _longest_step(self) -> float:
        """Return a time in which the speed changes by the law's characteristic speed at most.

        heyoka chooses a step from the series at its start. It would miss an exponential that is
        negligible there and rises before the step ends.
        """
        acceleration = abs(self._reaction()) + abs(self._x) + abs(self._y) + self._static
        return self._characteristic_speed / acceleration if acceleration > 0.0 else inf

    def _append_breakpoint(self, now: float, x: float, y: float, *, sticking: bool) -> None:
        if self._recording:
            time = self._time + now / self._drive.angular_frequency
            # Rounding must not take the time back.
            self._breakpoint_time = max(self._breakpoint_time, time)
            self._recorded.append((self._breakpoint_time, x, y, sticking))

    def _use_law(self) -> None:
        law = type(self._drive.friction)
        self._equations, self._sticking = self._integrators.stick(law)
        self._slipping = self._integrators.slip(law, recording=self._recording)

    def _set_parameters(self) -> None:
        values = self._equations.parameters(self._drive)
        self._belt_speed = values["belt_speed"]
        self._damping = values["damping"]
        self._static = values["static"]
        speed = self._drive.friction.characteristic_speed
        self._characteristic_speed = speed / self._drive.speed_scale
        values |= vars(self._gains)
        indices = self._equations.index
        for integrator in (self._slipping, self._sticking):
            if integrator is None:
                continue
            parameters = integrator.parameters
            count = len(parameters)
            for name, value in values.items():
                index = indices[name]
                if index < count:  # heyoka keeps them up to the last one that an equation uses
                    parameters[index] = value
