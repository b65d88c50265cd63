"""The UDP ports of a ROS domain: where its processes find each other (RTPS 2.5, 9.6.2.4)."""

import errno
import socket

DISCOVERY = 0
"""Number of the port that all processes of a domain share."""

FIRST_PROCESS = 10
"""Number of the first process's own port; each has two."""

MOST_PROCESSES = 100
"""Processes of a domain that Fast DDS looks for a port for."""

LARGEST_PORT = 65_535

_FIRST_PORT, _PORTS_OF_A_DOMAIN = 7400, 250


def port(domain: int, number: int) -> int:
    """Return the port of a domain with this number, from 0 to 249."""
    return _FIRST_PORT + _PORTS_OF_A_DOMAIN * domain + number


def is_free(taken: int, address: str = "", *, shared: bool = False) -> bool:
    """Return whether a UDP port can be listened on, or be `shared` with those who share it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, shared)
        try:
            probe.bind((address, taken))
        except OSError as error:
            return error.errno != errno.EADDRINUSE
    return True
