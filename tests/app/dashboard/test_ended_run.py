"""The bag that the page reads and offers: only the one that it was given, and no link."""

import asyncio
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from stickslip_ros.app.dashboard.ended_run import EndedRun
from stickslip_ros.app.dashboard.run_state import Health, RunState
from tests.record.runs import STAMPS, record

FILE = "bag_0.mcap"


def ended(named: Path | str, *readable: Path) -> EndedRun:
    """Return what is known of a run whose analyzer, or another node, named a bag."""
    state = RunState("/test", readable=[*map(str, readable)])
    state.health = {"analyzer": Health(figures={"bag": str(named)})}
    run = EndedRun(state)
    asyncio.run(run.read())
    return run


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """A bag, and beside it a file that is one, too, and that nobody has given."""
    record(tmp_path / "other", STAMPS[:70], STAMPS[:70])
    (tmp_path / "other" / "other_0.mcap").rename(tmp_path / "secret")
    shutil.rmtree(tmp_path / "other")
    record(tmp_path / "bag", STAMPS[:50], STAMPS[:50])
    return tmp_path / "bag"


def linked(file: Path, secret: Path) -> None:
    file.unlink()
    file.symlink_to(secret)


def hard_linked(file: Path, secret: Path) -> None:
    file.unlink()
    file.hardlink_to(secret)


def renamed(file: Path, secret: Path) -> None:
    secret.write_bytes(b"secret")
    secret.rename(file)


def in_a_linked_directory(file: Path, secret: Path) -> None:
    file.parent.rename(secret.parent / "other")
    secret.rename(secret.parent / "other" / file.name)
    file.parent.symlink_to("other")


def directory(file: Path, secret: Path) -> None:
    file.unlink()
    file.mkdir()
    secret.rename(file / "secret.mcap")


def pipe(file: Path, secret: Path) -> None:
    file.unlink()
    os.mkfifo(file)


ATTACKS = [linked, hard_linked, renamed, in_a_linked_directory, directory, pipe]
Attack = Callable[[Path, Path], None]


def test_the_bag_that_was_given_is_read_and_offered(bag: Path) -> None:
    run = ended(bag, bag)
    assert run._report["samples"] == 50
    assert run.file.read_bytes() == (bag / FILE).read_bytes()
    shutil.copy(bag / FILE, bag / "bag_1.mcap")
    run = ended(bag, bag)
    assert run._report
    assert run.file is None  # of several files none is offered


def test_a_bag_that_a_node_only_names_is_not_looked_at(bag: Path) -> None:
    for named in (bag, "/no/such/bag", "x" * 5000, "a\0b", ""):
        run = ended(named)
        assert (run.file, run._report, run._problem) == (None, {}, "")


@pytest.mark.parametrize("attack", ATTACKS)
def test_a_file_put_in_place_of_the_bag_is_neither_served_nor_read(
    bag: Path, attack: Attack
) -> None:
    recorded = (bag / FILE).read_bytes()
    before = ended(bag, bag)
    attack(bag / FILE, bag.parent / "secret")
    assert before.file.read_bytes() == recorded
    after = ended(bag, bag)
    assert after.file is None
    assert not after._report
    assert str(bag) in after._problem
    assert "secret" not in after._problem
