"""Arguments that several commands have."""

import argparse
import os
from collections.abc import Callable, Collection, Generator
from contextlib import contextmanager
from functools import partial
from math import inf, isfinite, nan, ulp
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.output import tell
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.files import open_regular, written
from stickslip_ros.quantities import number_of
from stickslip_ros.scenarios import DEFAULT_NAMESPACE, LONGEST_NAMESPACE
from stickslip_ros.text import shown

if TYPE_CHECKING:
    from stickslip_ros.scenarios.files import Scenario

DEFAULT_CONTROLLER = "(default: the one that the scenario has a section for)"
"""Default of --controller, for its help."""

_DOUBTFUL_RATIO = 10.0
"""Belt speed, in scales of speed, beyond which it may be in another unit."""


def add_scenario_file(parser: argparse.ArgumentParser) -> None:
    """Add SCENARIO and what modifies its values."""
    parser.add_argument(
        "scenario",
        metavar="SCENARIO",
        help="name of a shipped scenario (`stickslip list` prints them), or path of a scenario "
        "file ending in .yaml (`stickslip new` writes one)",
    )
    parser.add_argument(
        "-p",
        dest="overrides",
        action="append",
        default=[],
        metavar="NODE.PARAMETER=VALUE",
        help="override a parameter, as in -p plant.belt_speed=0.2 or 20cm/s (SI units; repeatable)",
    )
    parser.add_argument(
        "--base",
        metavar="SCENARIO",
        help="scenario that gives the values that a scenario file omits (default: the one that "
        "its section /**/scenario names)",
    )


def add_scenario(parser: argparse.ArgumentParser) -> None:
    """Add SCENARIO, what modifies it, --no-control and --controller."""
    add_scenario_file(parser)
    add_law(add_control(parser))


def add_control(parser: argparse.ArgumentParser) -> Any:
    """Add --yes and --no-control; return the group of this, for options that exclude it."""
    parser.add_argument(
        "--yes",
        action="store_true",
        help=f"take belt speeds beyond {_DOUBTFUL_RATIO:g} times the speed scale of the drive and "
        "its friction, which are refused otherwise: mm/s, perhaps, in place of m/s",
    )
    control = parser.add_mutually_exclusive_group()
    control.add_argument("--no-control", action="store_true", help="run without the controller")
    return control


def add_law(container: Any) -> None:
    """Add --controller, the name of a control law, to a parser or a group."""
    container.add_argument(
        "--controller",
        metavar="NAME",
        help=f"control law, as `stickslip list` prints it {DEFAULT_CONTROLLER}",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add --json."""
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object and nothing else"
    )


def add_out(
    parser: argparse.ArgumentParser, what: str, *, metavar: str = "FILE", more: str = ""
) -> None:
    """Add --out, which writes `what`; `more` ends its help."""
    meaning = f"write {what}; an existing file is refused{more}"
    parser.add_argument("--out", type=Path, metavar=metavar, help=meaning)


def add_namespace(parser: argparse.ArgumentParser) -> None:
    """Add --namespace, of nodes that run."""
    parser.add_argument(
        "--namespace",
        default=DEFAULT_NAMESPACE,
        metavar="NS",
        help="ROS namespace of the nodes (default: %(default)s)",
    )


def add_network(parser: argparse.ArgumentParser, meaning: str) -> None:
    """Add --network."""
    parser.add_argument("--network", action="store_true", help=meaning)


def check_new(option: str, path: Path) -> None:
    """Refuse `path`, given with `option`, where there is a file, or none can be written."""
    if path.exists():
        raise InvalidInputError(f"{option} {path}: exists already; it is not overwritten")
    check_writable(option, path)


def check_writable(option: str, path: Path) -> None:
    """Refuse `path`, given with `option`, where no file can be written, and leave it as it is."""
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"{option} {path}: there is no directory {path.parent}")
    with writing(option, path):
        if path.exists():
            open_regular(path).close()
            path.open("ab").close()
        TemporaryFile(dir=Path(os.path.realpath(path)).parent).close()


@contextmanager
def naming(option: str) -> Generator[None]:
    """Name in a refusal the option that it is about."""
    try:
        yield
    except InvalidInputError as error:
        raise InvalidInputError(f"{option} {error}") from None


@contextmanager
def writing(option: str, path: Path) -> Generator[None]:
    """Refuse `path`, given with `option`, if the system does not let it be written."""
    try:
        yield
    except OSError as error:
        raise InvalidInputError(f"{option} {path}: cannot be written: {error.strerror}") from None


def write_new(option: str, path: Path, text: str) -> None:
    """Write a text to `path`, given with `option`; a file that has come there is refused."""
    with writing(option, path), written(path) as file:
        file.write(text)


def scenario_of(
    arguments: argparse.Namespace,
    *overrides: str,
    namespace: str = DEFAULT_NAMESPACE,
    unused: Collection[str] = (),
    replaced: bool = False,
) -> "Scenario":
    """Return the scenario that was asked for, `overrides` applied after those given.

    A sentence on standard error names the values that are left to their defaults, except those that
    are `unused` (NODE.PARAMETER). The controller can be `replaced` by one that is no control law,
    for which the scenario may have sections of its own.
    """
    from stickslip_ros.scenarios.files import load_scenario
    from stickslip_ros.scenarios.keywords import described

    control = ["plant.expects_control=false"] if arguments.no_control else []
    asked = [*arguments.overrides, *control, *overrides]
    load = partial(
        load_scenario,
        arguments.scenario,
        asked,
        namespace,
        base=arguments.base,
        other_nodes=replaced,
    )
    controlled = not (arguments.no_control or replaced)
    scenario = with_law(load, None if replaced else arguments.controller, needed=controlled)
    values = scenario.as_dict()
    defaults: list[str] = []
    for full_name in scenario.left_to_defaults:
        if full_name not in unused:
            node, _, name = full_name.partition(".")
            unit = described(full_name).unit or ""
            defaults.append(f"{full_name} = {values[node][name]} {unit}".rstrip())
    if defaults:
        tell(
            f"{scenario.path}: using defaults: {', '.join(defaults)}; "
            "--base SCENARIO takes omitted values from another scenario"
        )
    foreign = [name for name in scenario.gains_of_base if name not in unused]
    if any(not name.endswith(".start_after") for name in foreign):
        tell(
            f"{scenario.path}: {', '.join(foreign)} are of {scenario.files[foreign[0]]}, for the "
            "drive there; `stickslip design` finds gains for this one"
        )
    warning = scenario.plant.friction.selected.warning()
    if warning is not None:
        tell(f"{scenario.path}: {warning}")
    check_speeds(arguments, scenario)
    return scenario


def check_speeds(arguments: argparse.Namespace, scenario: "Scenario", *speeds: float) -> None:
    """Refuse belt speeds (m/s) far beyond the scales of a drive and its law, but for --yes."""
    from stickslip_ros.show.quantities import Units

    plant, known = scenario.plant, scenario.plant.known
    used = [name for name in plant.drive_names() if name.startswith("friction.")]
    values = [plant.flat()[name] for name in used if known[name].unit == "m/s"]
    drive = plant.as_drive()
    fastest, scale = max([drive.fastest_belt, *map(abs, speeds)]), max([drive.speed_scale, *values])
    if fastest > _DOUBTFUL_RATIO * scale and not arguments.yes:
        shown, limit = Units.for_drive(drive).texts([fastest, scale], "m/s")
        raise InvalidInputError(
            f"a belt speed of {shown} is refused: more than {_DOUBTFUL_RATIO:g} times {limit}, the "
            "scale of speed of this drive and its friction; if it is meant, and in m/s, add --yes"
        )


def with_law(
    load: "Callable[..., Scenario]", controller: str | None, *, needed: bool = True
) -> "Scenario":
    """Load a scenario with the control law that --controller names.

    If no controller is `needed`, one of several that the file has a section for will do.
    """
    from stickslip_ros.scenarios.files import SeveralControllersError
    from stickslip_ros.scenarios.parameters import known_law

    if controller is not None:
        with naming("--controller:"):
            if is_program(controller):
                raise InvalidInputError(
                    f"{controller} is invalid: must be the name of a control law; only "
                    "`stickslip run` starts scripts and executables"
                )
            known_law(controller)
    try:
        return load(controller=controller)
    except SeveralControllersError as error:
        if not needed:
            return load(controller=error.laws[0])
        raise InvalidInputError(f"{error}, by --controller NAME") from None


def is_program(controller: str) -> bool:
    """Return whether --controller names a script or PACKAGE/EXECUTABLE instead of a control law."""
    return "/" in controller or controller.endswith(".py")


def law_constants(*needed: str) -> list[str]:
    """Return NODE.PARAMETER of the constants of every control law, except those `needed`."""
    from stickslip_ros.model.control import CONTROL_LAWS
    from stickslip_ros.scenarios.parameters import controller_node

    return [
        f"{controller_node(name)}.{constant}"
        for name, law in CONTROL_LAWS.items()
        for constant in law.constants()
        if constant not in needed
    ]


def namespace_of(text: str) -> str:
    """Return a ROS namespace that was given; InvalidInputError if it is none."""
    namespace = "/" + text.strip("/")
    tokens = namespace.split("/")[1:]
    if not all(token.isidentifier() and token.isascii() for token in tokens):
        raise InvalidInputError(
            f"--namespace {text!r}: must be names of letters, digits and _ joined by /"
        )
    if len(namespace) > LONGEST_NAMESPACE:
        raise InvalidInputError(
            f"--namespace {shown(text)}: has {len(namespace)} characters, and must have at most "
            f"{LONGEST_NAMESPACE}"
        )
    return namespace


def add_spread(parser: argparse.ArgumentParser, meaning: str) -> None:
    """Add --spread, of the constants of the drive."""
    parser.add_argument("--spread", type=_spread, default=0.0, metavar="SHARE", help=meaning)


def _spread(text: str) -> float | str:
    """Return a spread of constants from a text: a share, or fit."""
    try:
        return text if text == "fit" else float(text)
    except ValueError:
        allowed = "neither a share from 0 to 0.9 nor fit"
        raise argparse.ArgumentTypeError(f"{text!r} is {allowed}") from None


def whole(what: str, least: int, most: int) -> Callable[[str], int]:
    """Return a parser of whole numbers; `what` names them in messages, with {} for each bound."""

    def parse(text: str) -> int:
        if not (text.isascii() and text.isdigit() and least <= int(text) <= most):
            raise argparse.ArgumentTypeError(f"{text!r} is not {what.format(least, most)}")
        return int(text)

    return parse


def _number(what: str, unit: str, least: float, text: str) -> float:
    try:
        value = number_of(what, text, unit)
    except InvalidInputError:
        value = nan
    if not (isfinite(value) and value >= least):
        raise argparse.ArgumentTypeError(f"{shown(text)} is not {what}")
    return value


seconds = partial(_number, "a time in seconds, 0 or more", "s", 0.0)
speed = partial(_number, "a speed in m/s, 0 or more", "m/s", 0.0)
length = partial(_number, "a length in m above 0", "m", ulp(0.0))
shift = partial(_number, "a time in seconds", "s", -inf)
velocity = partial(_number, "a velocity in m/s", "m/s", -inf)
"""Parse what an option is given: a finite number, or one with a unit."""
