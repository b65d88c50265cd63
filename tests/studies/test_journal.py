"""Journals: an interrupted study gives the same result as an undisturbed one."""

import json
import os
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.studies import runner
from stickslip_ros.studies.columns import Point
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.plan import Axis, Continuation, Grid
from stickslip_ros.studies.settling import MotionState, SettlingOptions
from stickslip_ros.studies.study import Piece, Study
from tests.studies.studies import SHORT, free, points_of, speeds, stop_at

MINIMUM = Axis("plant.friction.minimum", 0.2, 0.5, 4)
SPEED = Axis("plant.belt_speed", 0.2, 0.5, 5)
STUDIES = {
    "carried on": Study(free(), Grid((MINIMUM, SPEED), Continuation.BOTH), SHORT),
    "one chain": Study(
        free(), Grid((replace(MINIMUM, first=0.41, last=0.2, count=9),), Continuation.UP), SHORT
    ),
}
"""Some of whose points are refused: the chains go on after them."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "study.part"


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
        return before, list(journal.columns.points())


def pieces_of(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setattr(runner, "_LARGEST_TASK", size)


@pytest.mark.parametrize("study", STUDIES.values(), ids=STUDIES)
def test_resumed_in_other_pieces_it_is_as_undisturbed(
    study: Study, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = points_of(study)
    assert [point.number for point in expected] == list(range(study.plan.size))
    assert any(point.reason is not None for point in expected)
    for size, until in ((2, 3), (1, 5)):
        pieces_of(monkeypatch, size)
        done = interrupted(study, path, until)
        assert until <= done < study.plan.size
    pieces_of(monkeypatch, 1000)
    assert resumed(study, path) == (done, expected)
    assert resumed(study, path) == (study.plan.size, expected)


def test_what_is_told_to_be_done_is_in_the_file(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A process that is killed loses nothing that it has told."""
    study = speeds(9, carry=Continuation.UP)
    pieces_of(monkeypatch, 3)
    found: list[tuple[float, int]] = []

    def progress(done: float) -> None:
        (copy := path.with_name("copy")).write_bytes(path.read_bytes())
        with Journal(study, copy) as journal:
            found.append((done, journal.count))

    with Journal(study, path) as journal:
        runner.run(journal, progress=progress)
    assert found == [(done, done) for done in (0, 3, 6, 9)]


@pytest.mark.parametrize("step", [97, pytest.param(1, marks=pytest.mark.long)])
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
            assert list(journal.columns.points()) == expected[: journal.count]
    for length in [0, 97, opening - 1, opening, third_last - 1, second_last - 7]:
        path.write_bytes(whole[:length])
        assert resumed(study, path)[1] == expected
        assert path.read_bytes().startswith(whole[:length])


def test_the_journal_of_another_study_is_refused_with_what_differs(tmp_path: Path) -> None:
    study = speeds(5)
    for number, (other, difference) in enumerate(
        (
            (replace(study, continuous=True), "continuous_control (True, not False)"),
            (replace(study, settling=SettlingOptions(7.0, 2)), "course.transient (7.0, not 5.0)"),
            (speeds(6), "plan.axes"),
            (speeds(5, carry=Continuation.UP), "plan.carry ('up', not None)"),
            (replace(study, scenario=free("plant.mass=2.0")), "plant.mass (2.0, not 1.0)"),
        )
    ):
        path = tmp_path / str(number)
        with Journal(other, path):
            pass
        before = path.read_bytes()
        with pytest.raises(InvalidInputError) as refusal:
            Journal(study, path)
        message = str(refusal.value)
        assert message.startswith(f"{path}: belongs to another study, which differs in ")
        assert difference in message
        assert message.count(", not ") == 1
        assert path.read_bytes() == before
        with Journal(other, path):  # a refused journal is not kept locked
            pass


def test_a_file_that_is_no_journal_is_refused_and_left_as_it_is(path: Path) -> None:
    version = b'{"format": "stickslip_ros study 1", "versions": {}}\n'
    for content in (
        b"something of somebody's",
        b"\n",
        b"{}\n",
        b"[]\n",
        b'{"format": "another"}',
        b"null\n",
        b"\xff\xfe\x00\n\n",
        b"[" * 100_000 + b"\n",
        version,
    ):
        path.write_bytes(content)
        other = "finish the study with that version"
        with pytest.raises(
            InvalidInputError, match=other if content is version else "is not the journal of a"
        ):
            Journal(speeds(5), path)
        assert path.read_bytes() == content
    with pytest.raises(InvalidInputError, match="journal"):
        Journal(speeds(2), Path(os.devnull))


GOOD: list[Any] = [*Point(0)]


def test_a_line_that_is_no_piece_is_refused_and_the_file_left_as_it_is(path: Path) -> None:
    study = speeds(5)
    with Journal(study, path):
        pass
    opening = path.read_bytes()
    for line in (
        "",
        "garbage",
        "[" * 100_000,
        "[]",
        '{"points": [], "end": null}',
        '{"points": [[0]], "end": null}',
        json.dumps({"points": [GOOD], "end": [1.0]}),
        json.dumps({"points": [[5, *GOOD[1:]]], "end": None}),
        json.dumps({"points": [[-1, *GOOD[1:]]], "end": None}),
        json.dumps({"points": [[0.0, *GOOD[1:]]], "end": None}),
        json.dumps({"points": [[*GOOD[:8], "walking", *GOOD[9:]]], "end": None}),
        json.dumps({"points": [[10**30, *GOOD[1:]]], "end": None}),
    ):
        sealed = f"{line} {crc32(line.encode(), len(opening)):08x}"
        for text in (line, sealed):
            path.write_bytes(content := opening + text.encode() + b"\n")
            assert_changed_at(len(opening), study, path, content)


def assert_changed_at(offset: int, study: Study, path: Path, content: bytes) -> None:
    with pytest.raises(InvalidInputError) as refusal:
        Journal(study, path)
    assert str(refusal.value) == (
        f"{path}: the line at byte {offset} is not as it was written; cut the file there, with "
        f"truncate -s {offset}, to keep the points before it"
    )
    assert path.read_bytes() == content


@pytest.mark.parametrize("step", [97, pytest.param(5, marks=pytest.mark.long)])
def test_no_byte_can_be_changed(path: Path, monkeypatch: pytest.MonkeyPatch, step: int) -> None:
    study = speeds(3)
    pieces_of(monkeypatch, 1)
    expected = resumed(study, path)[1]
    whole = path.read_bytes()
    starts = [0, *(place for place, byte in enumerate(whole, 1) if byte == ord("\n"))]
    named = len('{"format": "stickslip_ros study 2"')
    for place in {*range(named, len(whole) - 1, step), *starts[1:-1]}:
        changed = bytearray(whole)
        # A digit becomes another one, so that all of it could still be read.
        changed[place] ^= 1
        path.write_bytes(changed)
        assert_changed_at(max(s for s in starts if s <= place), study, path, bytes(changed))
    path.write_bytes(whole[:-1] + b" ")
    assert resumed(study, path) == (2, expected)


def test_no_line_can_be_moved_removed_or_repeated(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = speeds(4)
    pieces_of(monkeypatch, 1)
    resumed(study, path)
    opening, *pieces = path.read_bytes().splitlines(keepends=True)
    one, two, three, four = pieces
    for kept in ([one, three, four], [one, one, two], [one, three, two, four]):
        path.write_bytes(content := b"".join([opening, *kept]))
        assert_changed_at(len(opening + one), study, path, content)


def test_a_piece_that_is_there_twice_counts_once(path: Path) -> None:
    study = speeds(3)
    expected = resumed(study, path)[1]
    with Journal(study, path) as journal:
        journal.add(Piece(expected, None))
    with Journal(study, path) as journal:
        assert journal.count == 3
        assert list(journal.columns.points()) == expected


def test_a_journal_that_is_being_written_is_refused(path: Path) -> None:
    with Journal(speeds(5), path), pytest.raises(InvalidInputError, match="another process is"):
        Journal(speeds(5), path)
    with Journal(speeds(5), path) as journal:
        journal.discard()
    assert not path.exists()


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


@pytest.mark.parametrize("carry", [None, Continuation.UP])
def test_a_million_points_need_less_than_two_gigabytes(carry: Continuation | None) -> None:
    study, count = speeds(5_000, carry=carry), 5_000
    tracemalloc.start()
    try:
        with Journal(study) as journal:
            for number in range(count):
                text = json.dumps(Point(number, *[0.1] * 6, 6, turning_points=(0.1,) * 14))
                state = MotionState(0.1, 0.2, (0.3,))
                journal.add(Piece([Point.from_json(json.loads(text))], state))
            held, _ = tracemalloc.get_traced_memory()
            assert journal.count == count
    finally:
        tracemalloc.stop()
    assert held / count < 1_000.0
