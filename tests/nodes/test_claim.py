import subprocess
import sys
from contextlib import ExitStack

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.nodes.claim import claim
from tests.nodes.graph import wait_for

_HOLDER = """
import sys, time
from stickslip_ros.nodes.claim import claim

with claim(sys.argv[1], int(sys.argv[2])):
    print("held", flush=True)
    time.sleep(600.0)
"""


def test_a_namespace_is_free_as_soon_as_its_holder_is_killed() -> None:
    command = [sys.executable, "-c", _HOLDER, "/test/claimed", "7"]
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder,
        ExitStack() as ours,
    ):
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        ours.enter_context(claim("/test/claimed", 8))
        ours.enter_context(claim("/test/claimed/further", 7))
        for _ in range(3):
            with pytest.raises(InvalidInputError) as refusal, claim("/test/claimed", 7):
                pass
            assert "/test/claimed of the ROS domain 7 is in use" in str(refusal.value)
            assert f"process {holder.pid}" in str(refusal.value)
        holder.kill()
        holder.wait()

        def is_free() -> bool:
            try:
                ours.enter_context(claim("/test/claimed", 7))
            except InvalidInputError:
                return False
            return True

        wait_for(is_free, "the namespace is free")
