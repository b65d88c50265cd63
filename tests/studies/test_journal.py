"""Journals: an interrupted study gives the same result as an undisturbed one."""

import json
import os
import signal
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pathlib import Path

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.measures.cycle_measures import Measures
from stickslip_ros.studies import runner
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.plan import Axis, Carry, Grid
from stickslip_ros.studies.settling import MotionState, SettlingCourse
from stickslip_ros.studies.study import Piece, Point, Study
from tests.studies.studies import SHORT, free, speeds, stop_at

MINIMUM = Axis("plant.friction.minimum", 0.2, 0.5, 4)
SPEED = Axis("plant.belt_speed", 0.2, 0.5, 5)
STUDIES = {
    "each from its start": Study(free(), Grid((MINIMUM, SPEED)), SHORT),
    "carried on": Study(free(), Grid((MINIMUM, SPEED), Carry.BOTH), SHORT),
    "one chain": Study(free(), Grid((replace(MINIMUM, first=0.41, last=0.2, count=9),), Carry.UP),
                       SHORT),
}  # fmt: skip
"""Some of whose points are refused: the chains go on after them."""


@pytest.fixture(params=STUDIES.values(), ids=list(STUDIES))
def study(request: pytest.FixtureRequest) -> Study:
    return request.param


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "study.part"


def undisturbed(study: Study) -> list[Point]:
    with Journal(study) as journal:
        runner.run(journal)
        return list(journal.points())


def interrupted(study: Study, path: Path, count: int) -> int:
    """Begin the journal at `path`, and return how many points were done when it was interrupted."""
    with Journal(study, path) as journal:
        with pytest.raises(KeyboardInterrupt):
            runner.run(journal, progress=stop_at(count))
        return journal.count


def resumed(study: Study, path: Path) -> tuple[int, list[Point]]:
    """Return how many points the journal at `path` had, and all of them after it went on."""
    with Journal(study, path) as journal:
        before = journal.count
        runner.run(journal)
        assert journal.count == study.plan.size
        return before, list(journal.points())


def pieces_of(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setattr(runner, "_LARGEST_TASK", size)


def test_resumed_in_other_pieces_it_is_as_undisturbed(
    study: Study, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = undisturbed(study)
    assert [point.number for point in expected] == list(range(study.plan.size))
    assert any(point.reason is not None for point in expected)
    for size, until in ((2, 3), (3, 5), (1, 8)):
        pieces_of(monkeypatch, size)
        done = interrupted(study, path, until)
        assert until <= done < study.plan.size
    pieces_of(monkeypatch, 1000)
    assert resumed(study, path) == (done, expected)
    assert resumed(study, path) == (study.plan.size, expected)


_BEGIN = """
import sys
from pathlib import Path
from stickslip_ros.studies import runner
from stickslip_ros.studies.journal import Journal
from tests.studies.studies import speeds
from stickslip_ros.studies.plan import Carry

runner._LARGEST_TASK = 3
carry = Carry(sys.argv[2]) if len(sys.argv) > 2 else None
with Journal(speeds(10_000, carry=carry), Path(sys.argv[1])) as journal:
    runner.run(journal, progress=lambda done: print(done, flush=True))
"""


@pytest.mark.process
@pytest.mark.parametrize("carry", [None, Carry.UP])
def test_killed_it_goes_on_from_what_is_in_the_file(path: Path, carry: Carry | None) -> None:
    study = speeds(10_000, carry=carry)
    arguments = [str(path), *([] if carry is None else [carry])]
    with subprocess.Popen(
        [sys.executable, "-c", _BEGIN, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
    ) as process:
        assert process.stdout is not None
        reported = next(count for count in map(int, process.stdout) if count >= 100)
        process.send_signal(signal.SIGKILL)
        process.wait()
        reported = max([reported, *map(int, process.stdout)])
    with Journal(study, path) as journal:
        # It tells of a piece when that is in the file.
        assert reported <= journal.count <= reported + 3
        with pytest.raises(KeyboardInterrupt):
            runner.run(journal, progress=stop_at(600))
        found = list(journal.points())
    with Journal(study) as journal:
        with pytest.raises(KeyboardInterrupt):
            runner.run(journal, progress=stop_at(1000))
        expected = list(journal.points())
    assert len(found) >= 600
    assert expected[: len(found)] == found[: len(expected)]


@pytest.mark.parametrize("step", [19, pytest.param(1, marks=pytest.mark.long)])
def test_cut_off_at_any_byte_it_goes_on(
    path: Path, monkeypatch: pytest.MonkeyPatch, step: int
) -> None:
    study = STUDIES["one chain"]
    pieces_of(monkeypatch, 2)
    expected = resumed(study, path)[1]
    whole = path.read_bytes()
    ends = [place for place, byte in enumerate(whole, 1) if byte == ord("\n")]
    opening, *_, third_last, second_last, last = ends
    assert last == len(whole)
    counts = {end: min(2 * lines, 9) for lines, end in enumerate(ends)}
    for length in range(last, third_last, -step):
        path.write_bytes(whole[:length])
        with Journal(study, path) as journal:
            assert journal.count == counts[max(end for end in ends if end <= length)]
            assert list(journal.points()) == expected[: journal.count]
    for length in [*range(0, opening, 97), opening - 1, opening, third_last - 1, second_last - 7]:
        path.write_bytes(whole[:length])
        assert resumed(study, path)[1] == expected
        assert path.read_bytes().startswith(whole[:length])


def test_what_follows_a_cut_is_written_in_its_place(path: Path) -> None:
    study = speeds(3)
    expected = resumed(study, path)[1]
    path.write_bytes(path.read_bytes()[:-40] + b"")
    assert resumed(study, path) == (0, expected)
    assert path.read_bytes().count(b"\n") == 2


@pytest.mark.parametrize(
    ("other", "difference"),
    [
        (replace(speeds(5), continuous=True), "continuous_control (True, not False)"),
        (replace(speeds(5), course=SettlingCourse(7.0, 2)), "course.transient (7.0, not 5.0)"),
        (speeds(6), "plan.axes"),
        (speeds(5, carry=Carry.UP), "plan.carry ('up', not None)"),
        (replace(speeds(5), scenario=free("plant.mass=2.0")), "plant.mass (2.0, not 1.0)"),
    ],
    ids=["control", "course", "axes", "carry", "scenario"],
)
def test_the_journal_of_another_study_is_refused_with_what_differs(
    path: Path, other: Study, difference: str
) -> None:
    with Journal(other, path):
        pass
    before = path.read_bytes()
    with pytest.raises(InvalidInputError) as refusal:
        Journal(speeds(5), path)
    message = str(refusal.value)
    assert message.startswith(f"{path}: belongs to another study, which differs in ")
    assert difference in message
    assert message.count(", not ") == 1
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "content",
    [
        b"something of somebody's",
        b"something of somebody's\n",
        b"\n",
        b"{}\n",
        b"[]\n",
        b'{"format": "another"}',
        b"null\n",
        b"\xff\xfe\x00\n\n",
        b"[" * 100_000 + b"\n",
        b'{"format": "stickslip_ros study 1", "versions": {}}',
    ],
)
def test_a_file_that_is_no_journal_is_refused_and_left_as_it_is(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    with pytest.raises(InvalidInputError, match=r"is not the journal of a study|another study"):
        Journal(speeds(5), path)
    assert path.read_bytes() == content


GOOD = Point(0, Measures(None, None, None, None, None, None, 0, None), False, (), None).as_json()


@pytest.mark.parametrize(
    "line",
    [
        "",
        "garbage",
        "[]",
        "{}",
        '{"points": []}',
        '{"points": [], "end": null}',
        '{"points": [[0]], "end": null}',
        '{"points": [0], "end": null}',
        json.dumps({"points": [GOOD], "end": [1.0]}),
        json.dumps({"points": [GOOD], "end": 1.0}),
        json.dumps({"points": [[5, *GOOD[1:]]], "end": None}),
        json.dumps({"points": [[-1, *GOOD[1:]]], "end": None}),
        json.dumps({"points": [["0", *GOOD[1:]]], "end": None}),
        json.dumps({"points": [[0.0, *GOOD[1:]]], "end": None}),
        json.dumps({"points": [[*GOOD[:8], "walking", *GOOD[9:]]], "end": None}),
        json.dumps({"points": [[10**30, *GOOD[1:]]], "end": None}),
    ],
)
def test_a_line_that_is_no_piece_is_refused_and_the_file_left_as_it_is(
    path: Path, line: str
) -> None:
    study = speeds(5)
    with Journal(study, path):
        pass
    offset = path.stat().st_size
    with path.open("a") as file:
        file.write(f"{line}\n")
    before = path.read_bytes()
    with pytest.raises(
        InvalidInputError, match=f"the line at byte {offset} is not a piece of a study"
    ):
        Journal(study, path)
    assert path.read_bytes() == before


def test_a_piece_that_is_there_twice_counts_once(path: Path) -> None:
    study = speeds(3)
    expected = resumed(study, path)[1]
    *_, piece = path.read_bytes().splitlines(keepends=True)
    with path.open("ab") as file:
        file.write(piece)
    with Journal(study, path) as journal:
        assert journal.count == 3
        assert list(journal.points()) == expected


def test_a_journal_that_is_being_written_is_refused(path: Path) -> None:
    with Journal(speeds(5), path), pytest.raises(InvalidInputError, match="another process is"):
        Journal(speeds(5), path)
    with Journal(speeds(5), path):
        pass


def test_a_refused_journal_is_not_kept_locked(path: Path) -> None:
    with Journal(speeds(5), path):
        pass
    with pytest.raises(InvalidInputError, match="another study"):
        Journal(speeds(6), path)
    with Journal(speeds(5), path):
        pass


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    for path, reason in (
        (tmp_path / "nowhere" / "study.part", "No such file or directory"),
        (file / "study.part", "Not a directory"),
        (tmp_path, "Is a directory"),
    ):
        with pytest.raises(InvalidInputError, match=f"{path}: cannot be written: {reason}"):
            Journal(speeds(5), path)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_directory_without_permission_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(InvalidInputError, match="cannot be written: Permission denied"):
        Journal(speeds(5), tmp_path / "study.part")


def test_points_come_in_order_whatever_the_order_of_the_pieces() -> None:
    study = speeds(7)
    expected = undisturbed(study)
    with Journal(study) as journal:
        for numbers in ([4, 5], [6], [0, 1], [3, 2]):
            journal.add(Piece([expected[number] for number in numbers], None))
        assert list(journal.points()) == expected
        assert journal.count == 7


def test_a_discarded_journal_is_gone(path: Path) -> None:
    with Journal(speeds(2), path) as journal:
        assert path.exists()
        journal.discard()
    assert not path.exists()


@pytest.mark.parametrize(
    ("carry", "count", "piece", "most"),
    [
        pytest.param(None, 100_000, 100, 3.0, marks=pytest.mark.long),
        pytest.param(Carry.UP, 20_000, 100, 6.0, marks=pytest.mark.long),
        (None, 5_000, 1, 200.0),
        (Carry.UP, 5_000, 1, 500.0),
    ],
)
def test_memory_is_a_few_numbers_for_each_piece(
    carry: Carry | None, count: int, piece: int, most: float
) -> None:
    study = speeds(count, carry=carry)
    measures = Measures(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 6, None)
    point = Point(0, measures, True, (0.1,), None)
    with Journal(study) as journal:
        tracemalloc.start()
        try:
            for first in range(0, count, piece):
                points = [point._replace(number=first + n) for n in range(piece)]
                journal.add(Piece(points, MotionState(0.1 + first, 0.2 + first, (0.3 + first,))))
            taken = tracemalloc.take_snapshot()
        finally:
            tracemalloc.stop()
        # Tables of the interpreter, such as that of interned strings, may grow meanwhile.
        own = taken.filter_traces([tracemalloc.Filter(True, "*/stickslip_ros/*")])
        held = sum(each.size for each in own.statistics("filename"))
        assert journal.count == count
        assert held / count < most
