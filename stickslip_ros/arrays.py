"""Array types and tables of arrays."""

from collections.abc import Callable
from typing import Self

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def rms(values: FloatArray) -> float:
    """Return the root mean square.

    Examples
    --------
    >>> import numpy as np
    >>> from stickslip_ros.arrays import rms
    >>> rms(np.array([3.0, -3.0]))
    3.0
    """
    return float(np.sqrt(np.mean(values * values)))


class Table:
    """Base class of dataclasses whose fields are arrays of equal length, the columns.

    `len(table)` is the number of rows. `table[rows]` is a table of the selected rows, where `rows`
    is a slice, a boolean array or an array of indices.

    Examples
    --------
    >>> import numpy as np
    >>> from stickslip_ros.samples import ForceColumns
    >>> forces = ForceColumns(np.array([0, 1_000_000]), np.array([0.5, -2.0]))  # ns, N
    >>> len(forces)
    2
    >>> forces[forces.force > 0.0].stamp.tolist()
    [0]
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

        Returns
        -------
        Table
            A table of the same class with all rows; without `others`, this table itself.
        """
        if not others:
            return self
        table: Callable[..., Self] = type(self)
        columns = zip(*(vars(each).values() for each in (self, *others)), strict=True)
        return table(*map(np.concatenate, columns))
