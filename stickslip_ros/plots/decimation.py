"""Fewer points to draw, with every peak kept."""

import numpy as np

from stickslip_ros.physics.knots import FloatArray
from stickslip_ros.physics.samples import IntArray


def peaks(bucket: IntArray, *columns: FloatArray) -> IntArray:
    """Return the rows to draw: of each bucket the first, the last, and each column's extremes.

    `bucket` tells, in ascending order, which one each row belongs to; as long as the buckets are
    the columns of pixels of a picture, it looks the same as one of all rows. Rows ascend.
    """
    if not len(bucket):
        return np.empty(0, dtype=np.int64)
    begin = np.flatnonzero(np.r_[True, bucket[1:] != bucket[:-1]])
    size = np.diff(np.r_[begin, len(bucket)])
    kept = [begin, begin + size - 1]
    if int(size.max()) > 2:
        number = np.repeat(np.arange(len(begin)), size)
        for column in columns:
            order = np.lexsort((column, number))
            kept += [order[begin], order[begin + size - 1]]
    return np.unique(np.concatenate(kept))
