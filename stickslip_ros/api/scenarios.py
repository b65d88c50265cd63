"""Scenarios from names, paths, texts and keywords."""

from pathlib import Path
from typing import Any

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.scenarios.keywords import overrides_of

ScenarioLike = Scenario | str | Path
"""A scenario, its name, or the path of its file."""


def scenario(
    name_or_path: ScenarioLike,
    /,
    *overrides: str,
    base: str | Path | None = None,
    **parameters: Any,
) -> Scenario:
    """Return a scenario, with some parameters changed.

    Parameters
    ----------
    name_or_path : Scenario, str or Path
        Name of a scenario that ships (`"feed_drive"`, `"paper"`), path of a scenario file, or a
        scenario that is to be changed.
    *overrides : str
        Texts NODE.PARAMETER=VALUE, as after `-p` on the command line.
    base : str or Path, optional
        Scenario that gives the parameters that the file omits, by its name or path. By default
        this is the one that the section `scenario` of the file names.
    **parameters : Any
        Values in SI units. The keyword is the parameter's name with `_` for each `.`, such as
        `belt_speed`, `friction_static` or `initial_position`, where only one of plant, controller
        and analyzer has such a parameter. Keywords act after texts.

    Returns
    -------
    Scenario
        The parameters of every node, checked.

    Raises
    ------
    InvalidInputError
        If the scenario, a parameter or a value is not allowed, or if several nodes have a keyword's
        parameter.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> drive = ss.scenario("feed_drive", belt_speed=0.03, friction_static=0.35)
    >>> drive.plant.belt_speed, drive.plant.friction.static
    (0.03, 0.35)
    >>> ss.scenario(drive, "washout_controller.linear_gain=-2000").washout_controller.linear_gain
    -2000.0
    """
    texts = [*overrides, *overrides_of(parameters)]
    if not isinstance(name_or_path, Scenario):
        return load_scenario(str(name_or_path), texts, base=None if base is None else str(base))
    if base is not None:
        raise InvalidInputError(f"base = {base}: {name_or_path.name} is loaded, and needs no base")
    return name_or_path.overridden(texts)


def as_scenario(given: ScenarioLike) -> Scenario:
    """Return a scenario that is given as such, or by name or path."""
    return given if isinstance(given, Scenario) else load_scenario(str(given))
