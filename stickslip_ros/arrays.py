"""Array types, and tables of arrays."""

from collections.abc import Callable
from typing import Self

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


class Table:
    """Columns of equal length: a dataclass of arrays derives from it.

    `len(table)` is the number of its rows, `table[rows]` has some of them.
    """

    def __len__(self) -> int:
        return len(next(iter(vars(self).values())))

    def __getitem__(self, rows: slice | BoolArray | IntArray) -> Self:
        table: Callable[..., Self] = type(self)
        return table(*[column[rows] for column in vars(self).values()])

    def followed_by(self, *others: Self) -> Self:
        """Return these rows and those of the others behind them."""
        if not others:
            return self
        table: Callable[..., Self] = type(self)
        columns = zip(*(vars(each).values() for each in (self, *others)), strict=True)
        return table(*map(np.concatenate, columns))
