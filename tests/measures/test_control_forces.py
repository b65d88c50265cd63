import pickle
from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.measures.control_forces import ForceMeter, ForceSettler
from stickslip_ros.samples import ForceColumns


@given(
    st.lists(st.tuples(st.integers(-3, 9), st.sampled_from([-3.0, -1.0, 0.0, 1.0, 2.0, np.nan]))),
    st.lists(st.integers(0, 60)),
)
def test_peak_and_resting_force_are_those_of_the_whole_run(
    steps: list[tuple[int, float]], cuts: list[int]
) -> None:
    """However it is cut into blocks, and also where time goes back or a force is not a number."""
    stamp = 10**18 + np.cumsum([step for step, _ in steps], dtype=np.int64)
    force = np.array([value for _, value in steps], dtype=float)
    meter = ForceMeter()
    for block in np.split(np.arange(len(steps)), sorted(cuts)):
        meter.feed(ForceColumns(stamp[block], force[block]))
    stamp, force = stamp[np.isfinite(force)], np.abs(force[np.isfinite(force)])
    if len(stamp) == 0:
        assert meter.peak_force is None
        assert meter.resting_force is None
        return
    assert meter.peak_force == force.max()
    went_back = int(np.flatnonzero(np.diff(stamp) < 0).max(initial=-1))
    stamp, force = stamp[went_back + 1 :], force[went_back + 1 :]
    assert meter.resting_force == force[10 * (stamp[-1] - stamp) <= stamp[-1] - stamp[0]].max()


def test_a_long_run_takes_no_more_memory_than_a_short_one() -> None:
    meter = ForceMeter()
    sizes: list[int] = []
    for start in range(0, 200_000, 1000):
        numbers = np.arange(start, start + 1000)
        meter.feed(ForceColumns(10_000_000 * numbers, np.sin(0.01 * numbers)))
        sizes.append(len(pickle.dumps(meter)))
    assert max(sizes[100:]) < 1.5 * max(sizes[:100])


@given(
    sent=st.lists(st.tuples(st.integers(0, 5), st.sampled_from([0.5, 1.0, np.nan])), max_size=30),
    data=st.data(),
)
def test_as_many_forces_as_were_dropped_are_found_in_whatever_order_they_come(
    sent: list[tuple[int, float]], data: st.DataObject
) -> None:
    dropped = data.draw(st.lists(st.sampled_from(sent), unique_by=id)) if sent else []
    events = [(True, force) for force in sent] + [(False, force) for force in dropped]
    settler, acted = ForceSettler(), Counter[tuple[int, float]]()
    none = ForceColumns(np.array([], np.int64), np.array([]))

    def feed(sent: ForceColumns, dropped: ForceColumns, *, last: bool = False) -> None:
        settled, acting = settler.feed(sent, dropped, last=last)
        kept = settled[acting]
        acted.update(zip(kept.stamp.tolist(), kept.force.tolist(), strict=True))

    for is_sent, (stamp, force) in data.draw(st.permutations(events)):
        one = ForceColumns(np.array([stamp]), np.array([force]))
        feed(*((one, none) if is_sent else (none, one)))
    feed(none, none, last=True)
    finite = Counter(force for force in sent if np.isfinite(force[1]))
    assert acted == finite - Counter(force for force in dropped if np.isfinite(force[1]))
