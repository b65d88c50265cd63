"""Motions against scipy: stored references of laws with a memory, and what the studies have found.

`python -m benchmarks.memory_agreement` and `benchmarks.agreement` make the files.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import agreement, memory_agreement, random_drives
from benchmarks.memory_agreement import REQUIRED
from benchmarks.random_memory_drives import LAWS, STORED_EVERY, random_memory_drive
from stickslip_ros.model.friction import Directional

FOUND: dict[str, Any] = json.loads(
    (Path(memory_agreement.__file__).parent / "memory_agreement.json").read_text(encoding="utf-8")
)
STORED: dict[str, dict[str, Any]] = json.loads(
    Path(__file__).with_name("memory_references.json").read_text(encoding="utf-8")
)


@pytest.mark.parametrize(
    ("law", "seed"),
    [
        pytest.param(law, seed, marks=[pytest.mark.long] * (number != 1))
        for law, seeds in STORED.items()
        for number, seed in enumerate(seeds)
    ],
)
def test_a_motion_is_that_of_its_reference(law: str, seed: str) -> None:
    """Odd seeds have friction by direction."""
    drive = random_memory_drive(law, int(seed))
    found = drive.motion()[::STORED_EVERY]
    assert drive.error(found, np.array(STORED[law][seed])) < REQUIRED[law]


@pytest.mark.long
def test_many_elements_are_compiled_in_another_way_and_move_as_their_reference() -> None:
    drive = random_memory_drive("maxwell_slip", 19)
    ahead, back = (replace(each, elements=8) for each in (drive.forward, drive.backward))
    law: Any = drive.drive.friction
    both = (replace(each, elements=8) for each in (law.forward, law.reverse))
    drive = replace(
        drive, drive=replace(drive.drive, friction=Directional(*both)), forward=ahead, backward=back
    )
    assert drive.error(drive.motion(), drive.reference(1e-10)) < REQUIRED["maxwell_slip"]


def test_there_are_references_of_every_law() -> None:
    assert {law: len(seeds) for law, seeds in STORED.items()} == dict.fromkeys(LAWS, 5)


@pytest.mark.parametrize("law", LAWS)
def test_thirty_drives_of_each_law_agree(law: str) -> None:
    row = FOUND["by_law"][law]
    assert row["drives"] >= 30
    assert row["compared"] >= 0.8 * row["drives"]
    assert row["agree"] == row["compared"]
    assert row["worst_error"] < row["required"] == REQUIRED[law]
    assert row["median_time_ratio"] > row["least_time_ratio"] > 1.0
    assert FOUND["differing"] == []


COMPARED: dict[str, Any] = json.loads(
    (Path(agreement.__file__).parent / "agreement.json").read_text(encoding="utf-8")
)


def test_thirty_drives_of_each_law_and_each_course_agree() -> None:
    pairs = {f"{law}, {kind}" for law in random_drives.LAWS for kind in random_drives.KINDS}
    assert set(COMPARED["by_law_and_kind"]) == pairs
    assert set(COMPARED["by_place"]) == set(random_drives.PLACES)
    for row in [*COMPARED["by_law_and_kind"].values(), *COMPARED["by_place"].values()]:
        assert row["drives"] >= 30
        assert row["agree"] == row["compared"]
        assert max(row["worst_error"], row["worst_event_error"]) < COMPARED["required"] == 1e-7
    assert COMPARED["differing"] == []
    uncompared = COMPARED["all"]["drives"] - COMPARED["all"]["compared"]
    assert len(COMPARED["reference_not_accurate"]) == uncompared < 0.01 * COMPARED["all"]["drives"]
