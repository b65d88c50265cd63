"""Exceptions of the package: all that it raises on purpose derive from one class."""

from stickslip_ros.text import printable


class StickslipError(Exception):
    """Base class of all errors that stickslip_ros raises on purpose.

    The text is one sentence that names the thing, its value and what is allowed.

    Examples
    --------
    >>> from stickslip_ros.errors import StickslipError
    >>> from stickslip_ros.scenarios.files import load_scenario
    >>> try:
    ...     load_scenario("feed_drive", ["plant.mass=-1"])
    ... except StickslipError as error:
    ...     print(type(error).__name__)
    InvalidInputError
    """

    def __str__(self) -> str:
        return printable(super().__str__())


class InvalidInputError(StickslipError):
    """An input is refused; the text names the thing, its value and what is allowed."""


class BagError(InvalidInputError):
    """A bag cannot be read or written; the text names its path."""


class MessageError(BagError):
    """A message cannot be serialized or decoded; the text gives the reason."""


class RunError(StickslipError):
    """A run started but failed, for example because a node died or never became ready."""


def in_words(error: BaseException) -> str:
    """Return an exception of the code of others on one line; one of this package as it is."""
    if isinstance(error, StickslipError):
        return str(error)
    from traceback import format_exception_only  # --help needs none

    return " ".join(format_exception_only(error)[-1].split())
