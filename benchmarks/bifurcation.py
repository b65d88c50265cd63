"""How much longer than bare heyoka does a bifurcation diagram of 1,000 points take?

Ours: `bifurcation_diagram` for the drives of the paper's figures 2 and 3: compiling, transients,
turning points and measures. Peer: the same motions from rest over as many periods by heyoka's
integrators of slip and stick with their terminal events, compiled beforehand, and nothing but the
loop over these phases.
"""

import time
from math import copysign, ulp

import heyoka as hy

from benchmarks.slices import Row, by_turns, compare_times, show
from stickslip_ros.physics.drive import Drive
from stickslip_ros.physics.motion import UNBOUNDED_SPEED
from stickslip_ros.studies.bifurcation import COURSE, bifurcation_diagram
from stickslip_ros.studies.paper.figures import bifurcation_drives

POINTS, ROUNDS = 1000, 3
PERIODS = COURSE.transient + COURSE.cycles + 1


class BareMotion:
    """From rest, for any drive with cubic Stribeck friction and m = N = 1, not scaled."""

    def __init__(self) -> None:
        x, y = hy.make_vars("x", "y")
        damping, stiffness, static, belt, slope, cubic, sign = (hy.par[n] for n in range(7))
        r = y - belt
        reaction = stiffness * x + damping * y
        friction = -static * sign + slope * r - cubic * r * r * r
        falling = hy.event_direction.negative
        self.slip = hy.taylor_adaptive(
            [(x, y), (y, friction - reaction)],
            [0.0, 0.0],
            t_events=[
                hy.t_event(sign * r, direction=falling),
                hy.t_event(1.0 - sign * y / UNBOUNDED_SPEED, direction=falling),
            ],
            fast_math=True,
        )
        self.stick = hy.taylor_adaptive(
            [(x, y), (y, 0.0 * y)],
            [0.0, 0.0],
            t_events=[
                hy.t_event(static - reaction, direction=falling),
                hy.t_event(static + reaction, direction=falling),
            ],
        )

    def run(self, drive: Drive) -> tuple[float, float]:
        """Return displacement and velocity after all periods."""
        law, belt, stiffness = drive.friction, drive.belt_speed, drive.stiffness
        drop, static = law.static - law.minimum, law.static
        slope = 1.5 * drop / law.minimum_speed
        cubic = 0.5 * drop / law.minimum_speed**3
        for taylor in (self.slip, self.stick):
            values = [drive.damping, stiffness, static, belt, slope, cubic, 0.0]
            taylor.pars[:] = values[: len(taylor.pars)]
        now, end, x, y = 0.0, PERIODS * drive.natural_period, 0.0, 0.0
        sign = -1.0 if belt > 0.0 else 0.0
        while now < end:
            taylor = self.slip if sign else self.stick
            taylor.state[:] = x, y
            taylor.time = now
            if sign:
                taylor.pars[-1] = sign
            outcome = int(taylor.propagate_until(end)[0])
            x, y = taylor.state.tolist()
            now = float(taylor.time)
            if outcome == int(hy.taylor_outcome.time_limit):
                break
            taylor.reset_cooldowns()
            reaction = stiffness * x + drive.damping * belt
            sticks = sign and abs(reaction) <= static
            sign = 0.0 if sticks else -copysign(1.0, reaction)
            y = belt + sign * ulp(1.0)
        return x, y


def row(number: int) -> Row:
    _, drives = bifurcation_drives(number, POINTS)
    bare = BareMotion()

    def ours() -> float:
        start = time.perf_counter()
        bifurcation_diagram(drives)
        return time.perf_counter() - start

    def peer() -> float:
        start = time.perf_counter()
        for drive in drives:
            bare.run(drive)
        return time.perf_counter() - start

    our_times, times = by_turns(ROUNDS, ours, peer)
    return compare_times(
        f"figure {number}, {POINTS} points", our_times, "bare heyoka", times, required=0.5
    )


if __name__ == "__main__":
    show(__doc__, lambda: [row(number) for number in (2, 3)])
