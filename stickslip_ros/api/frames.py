"""Results as pandas and xarray objects; both packages are imported on first use."""

from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from typing import Any, NamedTuple

from stickslip_ros.errors import RunError
from stickslip_ros.plots.measure_table import LABELS
from stickslip_ros.plots.units import Units
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.keywords import described, keyword_of
from stickslip_ros.versions import versions


class Quantity(NamedTuple):
    """Label and SI unit of a column."""

    label: str
    unit: str = ""


def of_measure(name: str) -> Quantity:
    """Return label and unit of a measure."""
    return Quantity(*LABELS.get(name, (name.replace("_", " "), "")))


def of_parameter(parameter: str) -> Quantity:
    """Return label and unit of NODE.PARAMETER."""
    known = described(parameter)
    return Quantity(known.meaning.rstrip("."), known.unit or "")


def names_of(parameters: Iterable[str]) -> list[str]:
    """Return the names of the columns of NODE.PARAMETERs: their keywords."""
    return [keyword_of(parameter) for parameter in parameters]


def _units(columns: Any, quantities: Mapping[str, Quantity], units: Units) -> dict[str, str]:
    """Return the unit of each column that has numbers, by the CF conventions: 1 without any."""
    return {
        name: units.of_unit(quantity.unit) or "1"
        for name, quantity in quantities.items()
        if columns[name].dtype.kind in "fi"
    }


def provenance(scenario: Scenario) -> dict[str, str]:
    """Return the attributes of a data set: scenario, overrides and version."""
    return {
        "scenario": scenario.name,
        "overrides": " ".join(scenario.overrides),
        "stickslip_ros": versions().get("stickslip_ros", ""),
    }


def data_frame(
    columns: Mapping[str, Any],
    quantities: Mapping[str, Quantity],
    units: Units,
    *,
    index: str | None = None,
) -> Any:
    """Return columns as a pandas.DataFrame; its `attrs["units"]` has the unit of each."""
    frame = _optional("pandas").DataFrame(dict(columns))
    frame.attrs["units"] = _units(frame, quantities, units)
    return frame if index is None else frame.set_index(index)


def data_set(
    variables: Mapping[str, tuple[Sequence[str], Any]],
    coordinates: Mapping[str, Any],
    quantities: Mapping[str, Quantity],
    units: Units,
    attrs: Mapping[str, str],
) -> Any:
    """Return variables, each with its dimensions, as an xarray.Dataset with units."""
    found = _optional("xarray").Dataset(dict(variables), dict(coordinates), dict(attrs))
    for name, quantity in quantities.items():
        found[name].attrs["long_name"] = quantity.label
    for name, unit in _units(found, quantities, units).items():
        found[name].attrs["units"] = unit
    return found


def _optional(package: str) -> Any:
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        raise RunError(
            f"to_{package} needs {error.name}, which is not installed: "
            "pip install 'stickslip_ros[analysis]'"
        ) from None
