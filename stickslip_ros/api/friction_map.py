"""Friction maps: a law fitted to pairs of speed and force."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.api.page import Summary
from stickslip_ros.api.results import Drawing, Parts, Result
from stickslip_ros.arrays import FloatArray
from stickslip_ros.identification.fit import Estimate
from stickslip_ros.identification.friction_map import FittedCurve, fitted_curves
from stickslip_ros.record.table_columns import TableFormat
from stickslip_ros.record.table_file import table_of
from stickslip_ros.record.table_quantities import speed_and_force
from stickslip_ros.show.identification_table import constants_table
from stickslip_ros.show.quantities import SI, Units


@dataclass(frozen=True, eq=False, repr=False)
class FrictionMap(Result):
    """A friction law fitted to tests at constant speeds; it prints as a table of its constants."""

    tables: Sequence[Path]
    """The files."""
    velocity: FloatArray
    """Velocities of the tests, m/s; shape (pairs,)."""
    force: FloatArray
    """Forces that drive the slide, N; shape (pairs,)."""
    curves: Sequence[FittedCurve]
    """The law of both directions, or those of forward and of backward motion."""
    notes: Sequence[str]
    """Sentences on how the tables were read."""
    _units: Units = SI
    """Units in which it is shown."""

    @property
    def law(self) -> str:
        """Name of the friction law; of both directions, if they have different ones."""
        return " and ".join(dict.fromkeys(curve.law.name for curve in self.curves))

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Value, standard error and 95 % interval by parameter, such as `plant.friction.static`.

        SI units; the normal force is 1 N, so that coefficients are forces.
        """
        groups = ("plant.friction.", "plant.friction.reverse.")
        return {
            group + name: estimate
            for group, curve in zip(groups, self.curves, strict=False)
            for name, estimate in curve.estimates.items()
        }

    @property
    def error(self) -> float:
        """Root mean square of the forces less those of the law, N."""
        pairs = sum(curve.pairs for curve in self.curves)
        return (sum(curve.squares for curve in self.curves) / pairs) ** 0.5

    @override
    def parts(self) -> Parts:
        yield constants_table(f"{self._names}: law {self.law}", self.parameters, self._units)
        pairs = sum(curve.pairs for curve in self.curves)
        yield f"{pairs} pairs, error {self._units.text(self.error, 'N')}"
        yield from self.notes

    @override
    def _drawing(self) -> Drawing:
        from stickslip_ros.show.identification_figure import map_figure

        laws = [curve.law for curve in self.curves]
        pairs = self.velocity, self.force
        return partial(map_figure, self._names, *pairs, laws, units=self._units)

    @property
    def _names(self) -> str:
        return ", ".join(map(str, self.tables))

    @override
    def _entries(self) -> dict[str, Any]:
        return {
            "law": self.law,
            "parameters": {name: estimate.as_dict() for name, estimate in self.parameters.items()},
            "pairs": sum(curve.pairs for curve in self.curves),
            "error": self.error,
            "notes": [*self.notes],
        }

    @override
    def _summary(self) -> Summary:
        verdict = f"friction law {self.law}, error {self._units.text(self.error, 'N')}"
        return Summary("Friction map", self._names, verdict)


def friction_map(
    *tables: Path | str,
    columns: Mapping[str, str],
    law: str = "auto",
    rotary: bool = False,
    decimal: str | None = None,
    skip: int | None = None,
    encoding: str | None = None,
    force_constant: str | None = None,
    pitch: float | None = None,
) -> FrictionMap:
    r"""Fit a friction law to the pairs of speed and force of tests at constant speeds.

    Parameters
    ----------
    *tables : Path or str
        CSV or MAT files of one machine.
    columns : mapping
        Where they have `velocity` and `force`, as for `read_table`.
    law : {"auto", "coulomb", "exponential"}, optional
        Friction law; by default that with the least information criterion.
    rotary : bool, optional
        Whether the velocities are rad/s and the forces N m: they are shown as such.
    decimal, skip, encoding, force_constant, pitch : optional
        Form of the tables, as for `read_table`.

    Returns
    -------
    FrictionMap
        Constants with intervals.

    Raises
    ------
    BagError
        If a file cannot be read.
    InvalidInputError
        If a column is not there, or there are too few pairs.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import stickslip_ros as ss
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table = Path(folder, "map.csv")
    ...     rows = [f"{v / 100},{15.0 + 0.8 * v}" for v in range(1, 20)]
    ...     _ = table.write_text("\n".join(["v,f", *rows]))
    ...     fitted = ss.friction_map(table, columns={"velocity": "v", "force": "f"})
    >>> fitted.law, round(fitted.parameters["plant.friction.viscous"].value, 3)
    ('coulomb', 80.0)
    """
    form, paths = TableFormat(decimal, skip, encoding, rotary), [*map(Path, tables)]
    form = replace(form, force_constant=force_constant, pitch=pitch)
    read = [speed_and_force(table_of(path, form), columns) for path in paths]
    velocity, force = (
        np.concatenate([table.values[name] for table in read]) for name in ("velocity", "force")
    )
    notes = dict.fromkeys(note for table in read for note in table.notes)
    curves = fitted_curves(velocity, force, law)
    return FrictionMap(paths, velocity, force, curves, [*notes], Units(rotary=rotary))
