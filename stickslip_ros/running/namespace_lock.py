"""Allow one run in a namespace at a time: two plants on one topic would disturb each other."""

import socket
import struct
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from errno import EADDRINUSE
from hashlib import sha256

from stickslip_ros.errors import InvalidInputError


class NamespaceInUseError(InvalidInputError):
    """Another run is in the namespace."""


@contextmanager
def lock_namespace(namespace: str, domain: int) -> Generator[None]:
    """Hold a namespace of a ROS domain on this machine; the end of this process frees it.

    Raises NamespaceInUseError if another process of any user holds it. Linux only; on other
    systems, and in a sandbox that refuses such addresses, this does nothing.
    """
    if sys.platform != "linux":
        yield
        return
    # An abstract address leaves no file behind; containers share it if they share a network.
    address = f"\0stickslip_ros {sha256(f'{domain} {namespace}'.encode()).hexdigest()}"
    with socket.socket(socket.AF_UNIX) as held:
        try:
            held.bind(address)
            held.listen()
        except OSError as error:
            if error.errno == EADDRINUSE:
                raise NamespaceInUseError(
                    f"the namespace {namespace} of the ROS domain {domain} is in use by another "
                    f"run{_holder(address)}"
                ) from None
        yield


def _holder(address: str) -> str:
    """Return the process that holds an address, in words; empty if it is unknown."""
    with socket.socket(socket.AF_UNIX) as asking, suppress(OSError):
        asking.settimeout(1.0)
        asking.connect(address)
        layout = "3i"
        length = struct.calcsize(layout)
        credentials = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, length)
        process, _, _ = struct.unpack(layout, credentials)
        if process:  # otherwise it is in another container
            return f" (process {process})"
    return ""
