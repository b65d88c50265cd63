"""How much longer than bare heyoka does a sweep take, and how does it scale to two processes?

Ours: a whole sweep of the paper's drive over the belt speed, with 100 natural periods and four
measured cycles per point, including the check of the parameters, the motions, measures and turning
points, the journal and the table. Peer: heyoka's integrators of slip and stick over the same times,
compiled beforehand. Both without control, and with the paper's control without sampling.

With control sampled at 100 Hz, as by the nodes, a point takes 67,000 steps. Peer: the bare slip
integrator from sample to sample, with the same terminal events, and the washout filter in one line.

Two processes: the speed-up of a sweep of 20,000 points with two workers, including their start,
divided by the speed-up of two bare processes with half of the motions each.
"""

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from io import StringIO
from math import expm1
from multiprocessing import get_context
from statistics import median

from benchmarks.bare import BareMotion
from benchmarks.motion import bare_integrator
from benchmarks.slices import Row, by_turns, compare_times, show
from stickslip_ros.model.drive import Drive
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.columns import write_csv
from stickslip_ros.studies.plan import Axis
from stickslip_ros.studies.runner import compute_columns
from stickslip_ros.studies.settling import SettlingOptions
from stickslip_ros.studies.study import Study, sweep_study

POINTS, SAMPLED_POINTS, ROUNDS = 1000, 3, 5
MANY_POINTS, MANY_ROUNDS = 20_000, 3
SETTLING = SettlingOptions(transient=100.0)
LOW, HIGH = 0.02, 0.6
PERIOD = 0.01
GAINS = (2.0, -1.0, -1.0)
NO_CONTROL = "plant.expects_control=false"


def study(points: int, *, control: bool = False, continuous: bool = False) -> Study:
    scenario = load_scenario("paper", [] if control else [NO_CONTROL])
    axes = [Axis("plant.belt_speed", LOW, HIGH, points)]
    return sweep_study(scenario, axes, settling=SETTLING, continuous=continuous)


def drives(points: int) -> list[Drive]:
    asked = study(points)
    return [asked.case(number)[0].drive for number in range(points)]


def end(drive: Drive) -> float:
    return (SETTLING.transient + SETTLING.cycles + 2) * drive.natural_period


def ours(asked: Study, workers: int = 1) -> Callable[[], float]:
    def run() -> float:
        start = time.perf_counter()
        write_csv(StringIO(), compute_columns(asked, workers=workers), {})
        return time.perf_counter() - start

    return run


def bare(asked: list[Drive], *, controlled: bool = False) -> Callable[[], float]:
    motion = BareMotion(controlled=controlled)

    def run() -> float:
        start = time.perf_counter()
        for drive in asked:
            motion.run(drive, end(drive), GAINS)
        return time.perf_counter() - start

    return run


def bare_ticks(asked: list[Drive]) -> Callable[[], float]:
    taylor = bare_integrator()
    state, parameters = taylor.state, taylor.pars
    corner, linear, cubic = GAINS
    share = -expm1(-corner * PERIOD)

    def run() -> float:
        start = time.perf_counter()
        for drive in asked:
            state[:] = 0.0
            taylor.time = low_passed = 0.0
            for number in range(1, round(end(drive) / PERIOD) + 1):
                filtered = float(state[1]) - low_passed
                low_passed += share * filtered
                parameters[0] = linear * filtered + cubic * filtered * filtered * filtered
                taylor.propagate_until(number * PERIOD)
        return time.perf_counter() - start

    return run


def half(number: int) -> float:
    return bare(drives(MANY_POINTS)[number::2])()


def two_bare_processes() -> float:
    """Return the time of the slower one, without its start."""
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        return max(pool.map(half, range(2)))


def measure() -> list[Row]:
    rows: list[Row] = []
    for what, controlled in (("without control", False), ("continuous control", True)):
        asked = study(POINTS, control=controlled, continuous=controlled)
        peer = bare(drives(POINTS), controlled=controlled)
        times = by_turns(ROUNDS, ours(asked), peer)
        what = f"{what}, {POINTS} points"
        rows.append(compare_times(what, times[0], "bare heyoka", times[1], required=1 / 1.5))
    asked = study(SAMPLED_POINTS, control=True)
    times = by_turns(ROUNDS, ours(asked), bare_ticks(drives(SAMPLED_POINTS)))
    what = f"sampled control, {SAMPLED_POINTS} points"
    rows.append(compare_times(what, times[0], "bare heyoka", times[1], required=1 / 1.5))
    many = study(MANY_POINTS)
    one, two, bare_one, bare_two = by_turns(
        MANY_ROUNDS, ours(many), ours(many, 2), bare(drives(MANY_POINTS)), two_bare_processes
    )
    gain, bare_gain = (
        [alone / together for alone, together in zip(*times, strict=True)]
        for times in ((one, two), (bare_one, bare_two))
    )
    what = f"two processes over one, {MANY_POINTS} points"
    ratio = median(a / b for a, b in zip(gain, bare_gain, strict=True))
    peer_gain = median(bare_gain)
    rows.append(Row(what, "1", median(gain), "bare processes", peer_gain, ratio, 0.85))
    return rows


if __name__ == "__main__":
    show(__doc__, measure)
