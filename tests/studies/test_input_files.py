"""Files that a scenario names: a study has the content that it began with, or is refused."""

import pickle
from pathlib import Path
from random import Random

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.studies import runner
from stickslip_ros.studies.columns import Point
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.plan import Axis, Continuation, Grid
from stickslip_ros.studies.runner import compute_columns
from stickslip_ros.studies.study import Study, compute
from tests.studies.studies import SHORT, free, points_of, stop_at

FRICTION = "0,0.4\n0.1,0.35\n0.5,0.3\n", "0,0.45\n0.1,0.4\n0.5,0.35\n"
COURSE = "0,0\n3,0.1\n9,0\n", "0,0\n3,-0.1\n9,0.05\n"
SPEED = Axis("plant.belt_speed", 0.15, 0.4, 8)

FILES: dict[str, tuple[tuple[str, ...], tuple[str, str], Axis, Continuation | None]] = {
    "friction.file": (("friction.law=table",), FRICTION, SPEED, Continuation.UP),
    "friction.reverse.file": (
        ("friction.law=table",),
        FRICTION,
        Axis("plant.friction.static", 0.3, 0.4, 8),
        None,
    ),
    "load.file": (("load.kind=table",), COURSE, Axis("plant.load.start", 0.0, 1.0, 8), None),
    "belt.file": (("belt.kind=table",), COURSE, Axis("plant.damping", 0.0, 0.1, 8), None),
    "disturbance.file": (("disturbance.kind=table", "rate=5"), COURSE, SPEED, None),
}
"""For each parameter of the plant that names a file: what uses it, contents, and a sweep."""


def study_with(name: str, path: Path) -> Study:
    """Return a study with this file; it is read here, as by a command that starts."""
    values, _, axis, carry = FILES[name]
    given = [f"plant.{name}={path}", *(f"plant.{value}" for value in values)]
    if name == "friction.reverse.file":
        forward = path.with_name("forward.csv")
        forward.write_text(FRICTION[0])
        given.append(f"plant.friction.file={forward}")
    return Study(free(*given), Grid((axis,), carry), SHORT)


@pytest.fixture
def curve(tmp_path: Path) -> Path:
    return tmp_path / "curve.csv"


@pytest.fixture
def part(tmp_path: Path) -> Path:
    return tmp_path / "study.part"


@pytest.fixture(autouse=True)
def _small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "_LARGEST_TASK", 2)


def test_every_parameter_that_names_a_file_is_tried() -> None:
    named = {
        f"{node}.{name}"
        for node, model in NODE_PARAMETERS.items()
        for name, parameter in model.known.items()
        if parameter.file
    }
    assert named == {f"plant.{name}" for name in FILES}


@pytest.mark.parametrize("name", FILES)
def test_a_study_has_the_content_that_it_began_with(name: str, curve: Path, part: Path) -> None:
    ours, others = FILES[name][1]
    curve.write_text(others)
    other_points = points_of(study_with(name, curve))
    curve.write_text(ours)
    study = study_with(name, curve)
    with Journal(study, part) as journal, pytest.raises(KeyboardInterrupt):
        runner.run(journal, progress=stop_at(3))
    before = part.read_bytes()
    # With another content it is refused, and what happens to the file meanwhile changes no point.
    curve.write_text(others)
    with pytest.raises(InvalidInputError) as refusal:
        compute_columns(study_with(name, curve), path=part)
    message = str(refusal.value)
    assert message.startswith(f"{part}: belongs to another study, which differs in the content of ")
    assert f"the content of {curve} (" in message
    assert "finish that study, or remove this journal of it" in message
    assert part.read_bytes() == before
    expected = points_of(study)
    assert expected != other_points
    curve.unlink()
    elsewhere: Study = pickle.loads(pickle.dumps(study))  # as a worker gets it
    assert compute(elsewhere, range(8), None).points == expected
    curve.write_text(f"# measured\n{ours}")  # the numbers are the same
    with Journal(study_with(name, curve), part) as journal:
        assert 3 <= journal.count < 8
        runner.run(journal)
        assert list(journal.columns.points()) == expected


@pytest.mark.parametrize("trials", [4, pytest.param(40, marks=pytest.mark.long)])
def test_random_interruptions_neither_mix_nor_lose_a_point(
    trials: int, curve: Path, part: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    random = Random(20)
    names = [name for name in FILES if name != "disturbance.file"][:trials]
    expected: dict[tuple[str, str], list[Point]] = {}
    for name in names:
        for content in FILES[name][1]:
            curve.write_text(content)
            expected[name, content] = points_of(study_with(name, curve))
    for trial in range(trials):
        name, content, found = names[trial % len(names)], "", None
        while found is None:
            content = random.choice(FILES[name][1])
            monkeypatch.setattr(runner, "_LARGEST_TASK", random.randint(1, 4))
            curve.write_text(content)
            found = interrupted_at_random(study_with(name, curve), part, curve, random)
        assert found == expected[name, content]
        part.unlink()


def interrupted_at_random(
    study: Study, part: Path, curve: Path, random: Random
) -> list[Point] | None:
    """Return the points if the study ends before it is interrupted, or its journal is damaged."""
    stop = random.randint(1, 2 * study.plan.size)

    def progress(done: int) -> None:
        curve.unlink(missing_ok=True)
        if random.random() < 0.5:
            curve.write_text(random.choice((*FRICTION, *COURSE, "")))
        stop_at(stop)(done)

    try:
        with Journal(study, part) as journal:
            runner.run(journal, progress=progress)
            return list(journal.columns.points())
    except KeyboardInterrupt:
        content = bytearray(part.read_bytes()[: random.randint(0, 2 * part.stat().st_size)])
        if random.random() < 0.3:
            content[random.randrange(len(content))] ^= 1
        part.write_bytes(content)
    except InvalidInputError:  # another content, or a damaged journal
        if random.random() < 0.5:
            part.unlink()
    return None
