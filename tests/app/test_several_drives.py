"""Several drives on one machine at the same time, each started by its own `stickslip run`."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.record.reader import Recording
from stickslip_ros.testing import own_domain
from tests.app.conftest import Run, Start
from tests.nodes.graph import PATIENCE
from tests.nodes.processes import wait_for_samples
from tests.nodes.runs import messages_of

LOCKSTEP = ("--pace", "lockstep", "--duration", "5", "-p", f"plant.reply_timeout={PATIENCE}")
DRIVES = {
    "a": (*LOCKSTEP, "-p", "plant.belt_speed=0.2"),
    "b": (*LOCKSTEP, "--composed", "-p", "plant.belt_speed=0.3"),
    "c": (*LOCKSTEP, "--composed", "-p", "washout_controller.linear_gain=-0.3"),
    "d": ("--pace", "realtime", "--duration", "3", "--no-control", "-p", "plant.belt_speed=0.25"),
}


def become(user: int) -> list[str]:
    """Return what to put before a command for it to be another user's.

    Where this package is may be for root only: the other may read there, but has no other rights.
    """
    capabilities = (f"--{kind}-caps=+dac_read_search" for kind in ("inh", "ambient"))
    return ["setpriv", *capabilities, "--clear-groups", f"--reuid={user}", f"--regid={user}"]


def can_become_another_user() -> bool:
    """Return whether that is allowed here."""
    if os.geteuid() != 0 or shutil.which("setpriv") is None:
        return False
    return subprocess.run([*become(1234), "true"], check=False).returncode == 0


def arguments(name: str, bag: str, namespace: str) -> list[str]:
    return ["run", "paper", *DRIVES[name], "--bag", bag, "--namespace", namespace]


@pytest.mark.long
@pytest.mark.timeout(900)
def test_four_drives_at_once_do_not_hear_each_other(
    stickslip: Run, start_stickslip: Start, tmp_path: Path
) -> None:
    together = [start_stickslip(*arguments(name, name, f"/drive_{name}")) for name in DRIVES]
    for process in together:
        _, errors = process.communicate(timeout=3 * PATIENCE)
        assert process.returncode == 0, errors
    for name in DRIVES:
        done = stickslip(*arguments(name, f"{name}_alone", f"/drive_{name}"), "--composed")
        assert done.returncode == 0, done.stderr
        bag, alone = tmp_path / name, tmp_path / f"{name}_alone"
        if name == "d":
            assert motion_of(bag).shape == (4, 301)
            assert np.array_equal(motion_of(bag), motion_of(alone))
        else:
            assert messages_of(bag) == messages_of(alone)
            assert {len(messages) for messages in messages_of(bag).values()} == {0, 501}


def motion_of(bag: Path) -> np.ndarray:
    """Return the joint states but for their stamps, which in real time are those of the clock."""
    with Recording(bag) as recording:
        states = recording.joint_states
    return np.stack([states.position, states.velocity, states.friction_force, states.belt_position])


def test_a_second_run_in_the_same_namespace_is_refused(
    stickslip: Run, start_stickslip: Start, tmp_path: Path
) -> None:
    first = start_stickslip("run", "paper", "--composed", "--pace", "realtime", "--bag", "first")
    wait_for_samples(first, tmp_path / "first")
    done = stickslip("run", "paper", "--composed", "--bag", "second")
    assert done.returncode == 2
    refusal = done.stderr.splitlines()[-1]
    for text in ("/feed_drive", "another run", f"process {first.pid}", "--namespace"):
        assert text in refusal
    assert not (tmp_path / "second").exists()
    assert first.poll() is None


@pytest.mark.parametrize("home", [None, "/proc/none"])
def test_a_home_directory_need_not_be_there(
    stickslip: Run, process_environment: dict[str, str], home: str | None
) -> None:
    process_environment.pop("HOME", None)
    if home is not None:
        process_environment["HOME"] = home
    done = stickslip("run", "paper", "--composed", "--duration", "1", "--bag", "bag")
    assert done.returncode == 0, done.stderr
    started, reach = done.stderr.splitlines()
    assert started.startswith("paper: lockstep")
    assert reach.startswith("nodes in /feed_drive")


@pytest.mark.long
@pytest.mark.skipif(not can_become_another_user(), reason="only root becomes another user")
def test_two_users_do_not_disturb_each_other(
    process_environment: dict[str, str], tmp_path: Path
) -> None:
    """Nor do they in namespaces of one domain, or in one namespace of two domains."""
    process_environment.pop("HOME", None)
    domain = process_environment["ROS_DOMAIN_ID"]
    started: list[subprocess.Popen[str]] = []
    with own_domain() as other_domain:
        for user, namespace, own, how in (
            (1234, "/drive", domain, ()),
            (1235, "/drive", str(other_domain), ("--composed",)),
            (1235, "/other", domain, ("--composed",)),
        ):
            directory = tmp_path / f"{user}{namespace}"
            directory.mkdir(parents=True)
            os.chown(directory, user, user)
            command = [sys.executable, "-m", "stickslip_ros.app.main", "run", "paper", "--json"]
            started.append(
                subprocess.Popen(
                    [*become(user), *command, *LOCKSTEP, *how, "--namespace", namespace],
                    cwd=directory,
                    env=process_environment | {"ROS_DOMAIN_ID": own},
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    text=True,
                )
            )
        for process in started:
            output, errors = process.communicate(timeout=3 * PATIENCE)
            assert process.returncode == 0, errors
            assert json.loads(output)["samples"] == 501
