"""The exception family of the package: everything it raises on purpose derives from one class."""

from stickslip_ros.text import printable


class StickslipError(Exception):
    """Base of every error that stickslip_ros raises on purpose; its text is one clear sentence."""

    def __str__(self) -> str:
        return printable(super().__str__())


class InvalidInputError(StickslipError):
    """What came in is refused: it names the thing, its value and what is allowed."""


class BagError(InvalidInputError):
    """A bag that cannot be written where asked, or cannot be read; it names the path."""


class MessageError(BagError):
    """A message that cannot be packed, or cannot be understood; it says why."""


class RunError(StickslipError):
    """A run that was started properly but failed: a node died or never became ready."""
