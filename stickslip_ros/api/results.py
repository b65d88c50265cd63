"""Base of all results: they print, become JSON, draw themselves, and are tables."""

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from html import escape
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

import numpy as np

from stickslip_ros.api.page import Summary, write_page
from stickslip_ros.errors import RunError
from stickslip_ros.installed_packages import versions
from stickslip_ros.quantities import Quantity
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.show.quantities import Units
from stickslip_ros.tables import TextTable
from stickslip_ros.text import finite, printable

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

    from stickslip_ros.show.style import FigureStyle

Parts = Iterable[TextTable | str]
"""Tables and sentences that a result prints as."""
Drawing = Callable[..., Any]
"""Draws a figure in a `style`."""


class Result(ABC):
    """A result that prints as tables, plain in a terminal, HTML in a notebook, and has a figure.

    The command of the result prints, writes and draws the same.
    """

    @abstractmethod
    def parts(self) -> Parts:
        """Return the tables and sentences that the result prints as."""

    @abstractmethod
    def _drawing(self) -> Drawing:
        """Return what draws the figure; the parameters are the options of `plot`."""

    def draw(self, style: "FigureStyle", **options: Any) -> "Figure":
        """Return the figure in a style, as `plot` does in one of a name.

        Parameters
        ----------
        style : FigureStyle
            Size, resolution and layout.
        **options : Any
            Options of `plot` except the style.

        Returns
        -------
        matplotlib.figure.Figure
            The figure.

        Raises
        ------
        InvalidInputError
            If there is nothing to draw.
        RunError
            If a design has nothing to propose.
        """
        return self._drawing(**options)(style=style)

    @abstractmethod
    def _entries(self) -> Mapping[str, Any]:
        """Return the entries of `to_dict` but the versions; a long array is an iterator."""

    @abstractmethod
    def _summary(self) -> Summary:
        """Return what a page says of the result beside its tables and its figure."""

    def to_dict(self) -> dict[str, Any]:
        """Return the object that the command of this result prints with `--json`.

        Returns
        -------
        dict
            Values in SI units by name, ready for JSON: None for what does not exist or is not
            finite. `versions` are those of the software that is in use.
        """
        return {
            name: finite([*value] if isinstance(value, Iterator) else value)
            for name, value in self._with_versions().items()
        }

    def write_json(self, stream: TextIO) -> None:
        """Write `to_dict` as JSON; a long array as it comes, because its text takes much memory.

        Parameters
        ----------
        stream : TextIO
            Where it is written.
        """
        start = "{\n"
        for name, value in self._with_versions().items():
            stream.write(f"{start}  {json.dumps(name)}: ")
            if isinstance(value, Iterator):
                cells: Iterator[Any] = value
                for number, cell in enumerate(cells):
                    stream.write(f"{', ' if number else '['}{json.dumps(finite(cell))}")
                stream.write("]")
            else:
                text = json.dumps(finite(value), indent=2, allow_nan=False)
                stream.write(text.replace("\n", "\n  "))
            start = ",\n"
        stream.write("\n}\n")

    def to_html(self, path: Path | str, **options: Any) -> None:
        """Write the page that the command of this result writes with `--html`.

        Parameters
        ----------
        path : Path or str
            File to write; an existing one is replaced. The page needs no other file and no network.
        **options : Any
            Options of `plot` except the style.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        write_page(Path(path), self._summary(), self.parts(), partial(self.draw, **options))

    def _with_versions(self) -> dict[str, Any]:
        return {**self._entries(), "versions": versions()}

    def plot(self, *, style: str = "screen") -> "Figure":
        """Return the figure that the command of this result draws with `--plot`.

        Parameters
        ----------
        style : {"screen", "paper", "paper-double"}
            What the figure is for: a screen, or one column or two of a journal.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, which notebooks show.

        Raises
        ------
        InvalidInputError
            If there is nothing to draw, or `style` is unknown.
        RunError
            If a design has nothing to propose.
        """
        return self._drawn(style)

    def _drawn(self, style: str, **options: Any) -> "Figure":
        """Return the figure in the style of that name, as notebooks show it."""
        from stickslip_ros.show.style import style_named

        figure = self.draw(style_named(style), **options)
        vars(figure)["_repr_png_"] = partial(_png, figure)  # pyplot does not know it
        return figure

    def __repr__(self) -> str:
        return "\n".join(
            printable(part) if isinstance(part, str) else "\n".join(part.lines())
            for part in self.parts()
        )

    def _repr_html_(self) -> str:
        return "\n".join(
            f"<p>{escape(printable(part))}</p>" if isinstance(part, str) else part.html()
            for part in self.parts()
        )


class Table(NamedTuple):
    """The data of a result, from which tables of other packages are made."""

    columns: Mapping[str, Any]
    """Values by name: an array each, a list of texts, or a list of tuples of unequal length."""
    quantities: Mapping[str, Quantity]
    """Labels and units of the columns, in order; those that are not there are left out."""
    units: Units
    dimensions: Mapping[str, Any]
    """Axes of the values, in row-major order; a range has no values of its own."""
    attributes: Mapping[str, str]
    row_names: str | None = None
    """Column that is the index of a table of pandas."""

    def units_of(self, columns: Any) -> dict[str, str]:
        """Return the unit of each column of numbers, by the CF conventions: 1 without any."""
        return {
            name: self.units.of_unit(quantity.unit) or "1"
            for name, quantity in self.quantities.items()
            if name in columns and columns[name].dtype.kind in "fi"
        }


class TabularResult(Result):
    """A result that also becomes tables; pandas and xarray are imported on first use."""

    @abstractmethod
    def _table(self) -> Table:
        """Return the data."""

    def to_pandas(self) -> "DataFrame":
        """Return the data as a table of pandas.

        Returns
        -------
        pandas.DataFrame
            A row for each sample of a run by its time, each point of a study, or each check of a
            design; SI units, which are in `attrs["units"]`. Varied parameters have their keywords
            as names. A `control_force` that was recorded is the answer to the sample of its row,
            NaN where none came, and `stamp` is in ns.

        Raises
        ------
        RunError
            If pandas is not installed.
        """
        table = self._table()
        columns = table.columns
        names = [name for name in table.quantities if name in columns]
        frame = optional("pandas").DataFrame({name: columns[name] for name in names})
        frame.attrs["units"] = table.units_of(frame)
        return frame if table.row_names is None else frame.set_index(table.row_names)

    def to_xarray(self) -> "Dataset":
        """Return the data as a data set of xarray.

        Returns
        -------
        xarray.Dataset
            A variable for each column of `to_pandas`, with `units` and `long_name`; its own
            attributes name the scenario, overrides and version, or the bag. The dimension of a run
            is `time`, of a design `belt_speed`. Those of a study are the varied parameters by their
            keywords, or `point` for a random sample; `direction` for a sweep that is carried on;
            `turning_point` for the turning points, filled up with NaN. Where a text does not exist
            it is "".

        Raises
        ------
        RunError
            If xarray is not installed.
        """
        table = self._table()
        shape = [len(values) for values in table.dimensions.values()]
        coordinates = {
            name: values
            for name, values in table.dimensions.items()
            if not isinstance(values, range)
        }
        variables: dict[str, Any] = {}
        for name in table.quantities:
            if name in coordinates or name not in table.columns:
                continue
            dimensions, values = [*table.dimensions], table.columns[name]
            if isinstance(values, list):
                dimensions.append(name.removesuffix("s"))
                values = _padded(values)
            elif values.dtype == object:
                values = np.array([value or "" for value in values], dtype=str)
            variables[name] = dimensions, values.reshape(*shape, *values.shape[1:])
        dataset = optional("xarray").Dataset(variables, coordinates, dict(table.attributes))
        for name in dataset.variables:
            dataset[name].attrs["long_name"] = table.quantities[name].label
        for name, unit in table.units_of(dataset).items():
            dataset[name].attrs["units"] = unit
        return dataset


def column(values: Sequence[Any], *, text: bool = False) -> Any:
    """Return values as an array: numbers, with NaN for None, or texts as objects."""
    if text or any(isinstance(value, str) for value in values):
        return np.array(values, dtype=object)
    return np.array([np.nan if value is None else float(value) for value in values])


def attributes(scenario: Scenario) -> dict[str, str]:
    """Return the attributes of a data set: scenario, overrides and version."""
    return {
        "scenario": scenario.name,
        "overrides": " ".join(scenario.overrides),
        "stickslip_ros": versions().get("stickslip_ros", ""),
    }


def _padded(rows: Sequence[tuple[float, ...]]) -> Any:
    """Return rows of unequal length as an array, filled up with NaN."""
    padded = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
    for number, row in enumerate(rows):
        padded[number, : len(row)] = row
    return padded


def optional(package: str) -> Any:
    """Return a package for `to_PACKAGE`; raises RunError if it is not installed."""
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        raise RunError(
            f"to_{package} needs {error.name}, which is not installed: "
            "pip install 'stickslip_ros[analysis]'"
        ) from None


def _png(figure: "Figure") -> bytes:
    stream = BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue()
