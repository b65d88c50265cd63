"""The rules of the package's tests hold here, too."""

from tests.conftest import _no_process_unless_marked, pytest_runtest_setup

__all__ = ["_no_process_unless_marked", "pytest_runtest_setup"]
