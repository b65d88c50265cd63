"""Array types and tables of arrays."""

from collections.abc import Callable, Iterator
from typing import Self

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


_WINDOW = 1 << 16
"""Rows whose intermediate results stay in the cache of a processor."""


def windows(rows: int, overlap: int = 0) -> Iterator[slice]:
    """Yield consecutive slices of so many rows; each has the last rows of the one before, too.

    Work on a long array in such windows needs no memory for intermediate results, which takes more
    time than the work.
    """
    for begin in range(0, max(rows - overlap, 0), _WINDOW - overlap):
        yield slice(begin, min(begin + _WINDOW, rows))


def median(values: FloatArray) -> float:
    """Return the median; that of numpy loads its masked arrays first, which takes 15 ms."""
    ordered = np.sort(values)
    if ordered[-1] != ordered[-1]:  # nan comes last
        return np.nan
    middle = len(ordered) // 2
    return float(0.5 * (ordered[~middle] + ordered[middle]))


def rms(values: FloatArray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values * values)))


class Table:
    """Base class of dataclasses whose fields are arrays of equal length, the columns.

    `len(table)` is the number of rows. `table[rows]` is a table of the selected rows, where `rows`
    is a slice, a boolean array or an array of indices.
    """

    def __len__(self) -> int:
        return len(next(iter(vars(self).values())))

    def __getitem__(self, rows: slice | BoolArray | IntArray) -> Self:
        table: Callable[..., Self] = type(self)
        return table(*[column[rows] for column in vars(self).values()])

    def followed_by(self, *others: Self) -> Self:
        """Return a table of these rows followed by those of other tables.

        Parameters
        ----------
        *others : Table
            Tables of the same class, in order.
        """
        if not others:
            return self
        table: Callable[..., Self] = type(self)
        columns = zip(*(vars(block).values() for block in (self, *others)), strict=True)
        return table(*map(np.concatenate, columns))
