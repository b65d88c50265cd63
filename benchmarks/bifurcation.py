"""How much longer than bare heyoka does a bifurcation diagram of 1,000 points take?

Ours: `BifurcationFigure.columns` of the paper's figures 2 and 3, including compilation,
transients, turning points and measures. Peer: heyoka's integrators of slip and stick with their
terminal events, compiled beforehand, and the loop over these phases, for the same motions from
rest over the same number of periods.
"""

import time

from benchmarks.bare import BareMotion
from benchmarks.slices import Row, by_turns, compare_times, show
from reproduction.figures import SETTLING, BifurcationFigure, compute_figure

POINTS, ROUNDS = 1000, 3
PERIODS = SETTLING.transient + SETTLING.cycles + 2


def row(number: int) -> Row:
    figure = compute_figure(number, points=POINTS)
    assert isinstance(figure, BifurcationFigure)
    bare = BareMotion()

    def ours() -> float:
        start = time.perf_counter()
        columns = BifurcationFigure(number, figure.values).columns
        assert len(columns.regime) == POINTS
        return time.perf_counter() - start

    def peer() -> float:
        start = time.perf_counter()
        for drive in figure.drives:
            bare.run(drive, PERIODS * drive.natural_period)
        return time.perf_counter() - start

    our_times, times = by_turns(ROUNDS, ours, peer)
    return compare_times(
        f"figure {number}, {POINTS} points", our_times, "bare heyoka", times, required=0.5
    )


if __name__ == "__main__":
    show(__doc__, lambda: [row(number) for number in (2, 3)])
