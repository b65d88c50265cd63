"""Stamps of the samples of a loop: whole nanoseconds nearest to the instants n/rate."""

from fractions import Fraction

from stickslip_ros.stamps import NANOSECONDS


class SampleStamps:
    """Stamps of samples that are taken at a fixed rate."""

    def __init__(self, start: int, rate: float) -> None:
        """Start at a stamp, ns, with `rate` samples per second."""
        self._start = start
        self.period = NANOSECONDS / Fraction(rate)
        """Sample period, ns, exactly."""
        self._nanoseconds, self._samples = self.period.as_integer_ratio()

    def stamp(self, number: int) -> int:
        """Return the stamp (ns) of a sample, by its number from 0."""
        since = number * self._nanoseconds
        return self._start + (since if self._samples == 1 else _rounded(since, self._samples))

    def number(self, stamp: int) -> int:
        """Return the number of the sample whose stamp (ns) is nearest; negative before sample 0."""
        return _rounded((stamp - self._start) * self._samples, self._nanoseconds)


def _rounded(numerator: int, denominator: int) -> int:
    """Return the quotient rounded to the nearest whole number; a half is rounded to even."""
    whole, rest = divmod(numerator, denominator)
    excess = 2 * rest - denominator
    return whole + (excess > 0 or (excess == 0 and whole % 2))
