import errno
import os
import subprocess
import sys
from contextlib import ExitStack

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.running.namespace_lock import lock_namespace
from tests.nodes.graph import wait_for

_HOLDER = """
import sys, time
from stickslip_ros.running.namespace_lock import lock_namespace

with lock_namespace(sys.argv[1], int(sys.argv[2])):
    print("held", flush=True)
    time.sleep(600.0)
"""


def test_a_sandbox_that_refuses_to_bind_does_not_hinder_a_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr("socket.socket.bind", refuse)
    with lock_namespace("/test/locked", 7):
        pass


@pytest.mark.process
def test_a_namespace_is_free_as_soon_as_its_holder_is_killed() -> None:
    # All who test on this machine share these names.
    namespace = f"/test/locked_{os.getpid()}"
    command = [sys.executable, "-c", _HOLDER, namespace, "7"]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder,
        ExitStack() as ours,
    ):
        ours.callback(holder.kill)
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        ours.enter_context(lock_namespace(namespace, 8))
        ours.enter_context(lock_namespace(f"{namespace}/further", 7))
        for _ in range(3):
            with pytest.raises(InvalidInputError) as refusal, lock_namespace(namespace, 7):
                pass
            assert f"{namespace} of the ROS domain 7 is in use" in str(refusal.value)
            assert f"process {holder.pid}" in str(refusal.value)
        holder.kill()
        holder.wait()

        def is_free() -> bool:
            try:
                ours.enter_context(lock_namespace(namespace, 7))
            except InvalidInputError:
                return False
            return True

        wait_for(is_free, "the namespace is free")
