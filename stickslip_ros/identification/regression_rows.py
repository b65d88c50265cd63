"""Rows of the equation of motion from filtered records: what each constant multiplies."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.covariance import BLOCKS
from stickslip_ros.identification.filtered import Filtered
from stickslip_ros.identification.fit import CURVE_POINTS
from stickslip_ros.identification.identified_law import IdentifiedLaw

_DIRECTION_SHARE = 0.05
"""Least share of the rows of a direction that has a curve of its own."""
LINEAR = ("mass", "damping", "stiffness", "bias_force")
"""Constants of the equation beside those of friction."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of the equation of motion of all records, arrays of shape (rows,)."""

    parts: Sequence[Filtered]
    columns: Mapping[str, FloatArray]
    """Factor of each of `LINEAR`."""
    force: FloatArray
    """Known forces, N."""
    directions: Sequence[float]
    """Signs of the relative speed that occur: 1, -1 or both."""
    delay: float | None = None
    """Time from a sample until its force acts, s; None if nothing is known of one."""

    @classmethod
    def of_records(cls, parts: Sequence[Filtered]) -> "Rows":
        """Return the rows of filtered records."""

        def joined(values: Callable[[Filtered], FloatArray]) -> FloatArray:
            return np.concatenate([part.rows(values(part)) for part in parts])

        force = joined(lambda part: part.force)
        if len(force) < 4 * BLOCKS:
            raise InvalidInputError(
                f"the slide slips in {len(force)} rows of the recordings: identification needs "
                f"at least {4 * BLOCKS}"
            )
        relative = joined(lambda part: part.relative_speed)
        counts = {sign: np.count_nonzero(relative * sign > 0.0) for sign in (1.0, -1.0)}
        least = _DIRECTION_SHARE * len(relative)
        directions = [sign for sign, count in counts.items() if count > least]
        if not directions:
            raise InvalidInputError(
                "the slide never slips in the recordings: nothing is identifiable"
            )
        return cls(
            parts,
            {
                "mass": joined(lambda part: part.acceleration),
                "damping": joined(lambda part: part.velocity),
                "stiffness": joined(lambda part: part.position),
                "bias_force": -np.ones(len(force)),
            },
            force,
            directions,
        )

    @property
    def resting(self) -> bool:
        """Whether the slide rests in a record."""
        return any(part.weight is not None for part in self.parts)

    @cached_property
    def relative_speed(self) -> FloatArray:
        """Velocity less that of the belt, m/s."""
        return np.concatenate([part.rows(part.relative_speed) for part in self.parts])

    @cached_property
    def speeds(self) -> FloatArray:
        """Sliding speeds above zero, m/s, sorted."""
        speeds = np.abs(self.relative_speed)
        return np.sort(speeds[speeds > 0.0])

    @cached_property
    def curve_speeds(self) -> FloatArray:
        """Speeds of the points that stand for a curve, m/s: 0 and those recorded."""
        low, high = np.quantile(self.speeds, [0.02, 1.0])
        return np.concatenate([[0.0], np.geomspace(low, high, CURVE_POINTS - 1)])

    def least_shape(self, curve: IdentifiedLaw) -> float:
        """Return the smallest shape of a curve that the rows tell, m/s."""
        return curve.least_shape * float(np.quantile(self.speeds, 0.02))

    def friction_terms(self, curve: IdentifiedLaw, shapes: FloatArray) -> FloatArray:
        """Return sgn(v_r) times the terms of a curve for each direction, shape (rows, terms)."""
        made: list[FloatArray] = []
        for part in self.parts:
            speed, columns = part.relative_speed, list[FloatArray]()
            for number, sign in enumerate(self.directions):
                shape = float(shapes[number]) if len(shapes) else 1.0
                signs = np.sign(speed)
                if len(self.directions) > 1:
                    signs = np.where(speed * sign > 0.0, sign, 0.0)
                columns.append(signs[:, None] * curve.terms(np.abs(speed), shape))
            terms = np.hstack(columns)
            if curve.deflection > 0.0:
                path = np.abs(speed) * (part.time[1] - part.time[0]) / curve.deflection
                terms = _followed(terms, path)
            made.append(part.rows(terms))
        return np.vstack(made)


def _followed(terms: FloatArray, path: FloatArray) -> FloatArray:
    """Return terms, shape (samples, terms), as friction follows them over a path.

    `path` is that from the sample before, in deflections; the terms have the sign of the slip.
    """
    followed = np.empty_like(terms)
    state = terms[0]
    for number, (target, kept) in enumerate(zip(terms, np.exp(-path).tolist(), strict=True)):
        state = target + (state - target) * kept
        followed[number] = state
    return followed
