"""Arguments that several commands have."""

import argparse
import sys
import warnings
from collections.abc import Callable, Collection, Generator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from math import isfinite
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.namespace import DEFAULT_NAMESPACE, LONGEST_NAMESPACE
from stickslip_ros.text import printable, shown
from stickslip_ros.versions import versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip_ros.plots.style import FigureStyle
    from stickslip_ros.scenarios.files import Scenario

DEFAULT_CONTROLLER = "(default: the one that the scenario has a section for)"
"""What --controller is by default, for its help."""

_FIGURE_FILES = (".png", ".svg", ".pdf")

_SMALLEST, _LARGEST = 2, 50
"""Width and height of a figure, inches."""
_DPI = 20, 600
_MOST_PIXELS = 2e8
_STYLES = "screen", "paper", "paper-double"
"""The names of `plots.style.STYLES`; importing that takes long."""


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
        help="override a parameter, as in -p plant.belt_speed=0.2 (SI units; repeatable)",
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
    """Add --no-control; return its group, for options that exclude it."""
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


def add_columns(parser: argparse.ArgumentParser) -> None:
    """Add --columns, which says what the columns of tables are."""
    parser.add_argument(
        "--columns",
        metavar="QUANTITY=COLUMN,...",
        help="where a table has time, position, velocity, force, belt_velocity, friction_force, "
        "disturbance and reference: names of columns, numbers and products of them, in SI units, "
        "as in time=t,position=x,force=vir*35.15,belt_velocity=0.04",
    )


def columns_of(text: str | None) -> dict[str, str] | None:
    """Return the columns that --columns names, by quantity."""
    if text is None:
        return None
    found: dict[str, str] = {}
    for part in text.split(","):
        quantity, equals, column = (each.strip() for each in part.partition("="))
        if not (quantity and equals and column) or quantity in found:
            raise InvalidInputError(
                f"--columns {text}: must be QUANTITY=COLUMN,..., each quantity once, as in "
                "time=t,position=x"
            )
        found[quantity] = column
    return found


def add_part(parser: argparse.ArgumentParser, *, tables: str = "") -> None:
    """Add the options that say which part of a recording is used, and of which drive.

    `tables` says what the belt speed is for besides bags.
    """
    parser.add_argument(
        "--belt-speed",
        type=velocity,
        metavar="V",
        help=f"belt speed, m/s, for {tables}a bag whose joint states have a single joint, whatever "
        "its name",
    )
    parser.add_argument(
        "--from",
        dest="start",
        type=seconds,
        default=0.0,
        metavar="S",
        help="start of the part that is used, s from the first sample of each recording "
        "(default: 0)",
    )
    parser.add_argument(
        "--to",
        dest="end",
        type=seconds,
        default=float("inf"),
        metavar="S",
        help="end of the part that is used, s from the first sample of each recording "
        "(default: the end)",
    )
    parser.add_argument(
        "--namespace",
        metavar="NS",
        help="ROS namespace of the drive, if a bag holds several",
    )


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


def add_plot(parser: argparse.ArgumentParser, shown: str) -> None:
    """Add --plot, which draws what is `shown`, and what the figure is to look like."""
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="FILE",
        help=f"draw {shown} ({', '.join(_FIGURE_FILES)}); an existing file is replaced",
    )
    parser.add_argument(
        "--size",
        type=_size,
        metavar="WxH",
        help="width and height of the figure, inches, as in --size 6x4",
    )
    add_style(parser)
    parser.add_argument(
        "--dpi",
        type=_dpi,
        metavar="N",
        help="dots per inch of the figure (default: 130, in the styles for paper 300)",
    )
    parser.add_argument("--no-title", action="store_true", help="omit the title of the figure")


def add_style(parser: argparse.ArgumentParser) -> None:
    """Add --style, a name of `plots.style.STYLES`."""
    parser.add_argument(
        "--style",
        choices=_STYLES,
        help="what a figure is for: a screen, or a column (85 mm) or two (180 mm) of a journal, "
        "with fonts of 8 points (default: screen)",
    )


def check_figure(arguments: argparse.Namespace) -> None:
    """Refuse a figure that cannot be written, before anything is computed."""
    path: Path | None = arguments.plot
    size: tuple[float, float] | None = arguments.size
    dpi: int | None = arguments.dpi
    given = {
        "--size": size is not None and f"{size[0]:g}x{size[1]:g}",
        "--dpi": dpi,
        "--style": arguments.style,
        "--no-title": arguments.no_title and "",
    }
    shown = [
        f"{name} {value}".rstrip() for name, value in given.items() if value not in (None, False)
    ]
    if path is None:
        if shown:
            raise InvalidInputError(f"{' '.join(shown)}: needs --plot FILE, which is not given")
        return
    if path.suffix.lower() not in _FIGURE_FILES:
        raise InvalidInputError(f"--plot {path}: must end in one of {', '.join(_FIGURE_FILES)}")
    if size is not None and dpi is not None and size[0] * size[1] * dpi**2 > _MOST_PIXELS:
        raise InvalidInputError(
            f"{' '.join(shown[:2])}: would be {size[0] * size[1] * dpi**2:.3g} pixels, and must be "
            f"at most {_MOST_PIXELS:g}"
        )
    _check_writable("--plot", path)


def write_figure(arguments: argparse.Namespace, draw: "Callable[[FigureStyle], Figure]") -> None:
    """Draw a figure as it is asked for, and write it to the file that --plot names."""
    from stickslip_ros.plots.style import STYLES, save

    style = replace(
        STYLES[arguments.style or "screen"],
        size=arguments.size,
        titled=not arguments.no_title,
    )
    figure = draw(style)
    with writing("--plot", arguments.plot), warnings.catch_warnings():
        warnings.filterwarnings("error", "constrained_layout not applied", UserWarning)
        try:
            save(figure, arguments.plot, dots_per_inch=arguments.dpi or style.dots_per_inch)
        except UserWarning:
            width, height = figure.get_size_inches()
            raise InvalidInputError(
                f"--size {width:g}x{height:g}: is too small for this figure"
            ) from None


def _size(text: str) -> tuple[float, float]:
    """Parse WIDTHxHEIGHT, inches."""
    parts = text.lower().split("x")
    try:
        width, height = (float(part) for part in parts)
    except ValueError:
        width = height = float("nan")
    if not (_SMALLEST <= width <= _LARGEST and _SMALLEST <= height <= _LARGEST):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not WIDTHxHEIGHT in inches, each from {_SMALLEST} to {_LARGEST}, such as "
            "6x4"
        )
    return width, height


def _dpi(text: str) -> int:
    if not (text.isascii() and text.isdigit() and _DPI[0] <= int(text) <= _DPI[1]):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a whole number of dots per inch from {_DPI[0]} to {_DPI[1]}"
        )
    return int(text)


def check_new(option: str, path: Path) -> None:
    """Refuse `path`, given with `option`, where there is a file, or none can be written."""
    if path.exists():
        raise InvalidInputError(f"{option} {path}: exists already; it is not overwritten")
    _check_writable(option, path)


def _check_writable(option: str, path: Path) -> None:
    """Refuse `path`, given with `option`, where no file can be written, and leave it as it is."""
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"{option} {path}: there is no directory {path.parent}")
    with writing(option, path):
        if path.exists():
            path.open("ab").close()
        else:
            TemporaryFile(dir=path.absolute().parent).close()


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


def scenario_of(
    arguments: argparse.Namespace,
    *overrides: str,
    namespace: str = DEFAULT_NAMESPACE,
    other_nodes: bool = False,
    unused: Collection[str] = (),
    replaced: bool = False,
) -> "Scenario":
    """Return the scenario that was asked for, `overrides` applied after those given.

    A sentence on standard error names the values that are left to their defaults, except those that
    are `unused` (NODE.PARAMETER). The controller can be `replaced` by one that is no control law.
    """
    with interrupts_kept():
        from stickslip_ros.scenarios.files import load_scenario
        from stickslip_ros.scenarios.parameter_field import known_parameters
        from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
    control = ["plant.expects_control=false"] if arguments.no_control else []
    asked = [*arguments.overrides, *control, *overrides]
    load = partial(
        load_scenario,
        arguments.scenario,
        asked,
        namespace,
        base=arguments.base,
        other_nodes=other_nodes,
    )
    controlled = not (arguments.no_control or replaced)
    scenario = with_law(load, None if replaced else arguments.controller, needed=controlled)
    values = scenario.as_dict()
    defaults: list[str] = []
    for full_name in scenario.left_to_defaults:
        if full_name not in unused:
            node, _, name = full_name.partition(".")
            unit = known_parameters(NODE_PARAMETERS[node])[name].unit or ""
            defaults.append(f"{full_name} = {values[node][name]} {unit}".rstrip())
    if defaults:
        sentence = (
            f"{scenario.path} does not give {', '.join(defaults)}: these are the defaults; "
            "--base SCENARIO takes omitted values from another scenario"
        )
        print(printable(sentence), file=sys.stderr)
    warning = scenario.plant.friction.as_law().warning()
    if warning is not None:
        print(printable(f"{scenario.path}: {warning}"), file=sys.stderr)
    return scenario


def with_law(
    load: "Callable[..., Scenario]", controller: str | None, *, needed: bool = True
) -> "Scenario":
    """Load a scenario with the control law that --controller names.

    If no controller is `needed`, one of several that the file has a section for will do.
    """
    from stickslip_ros.scenarios.files import SeveralControllersError, known_law

    if controller is not None:
        with naming("--controller:"):
            if is_program(controller):
                raise InvalidInputError(
                    f"{controller} is refused: must be the name of a control law; only "
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
    from stickslip_ros.physics.model.control import CONTROL_LAWS
    from stickslip_ros.scenarios.parameters import controller_node

    return [
        f"{controller_node(name)}.{constant}"
        for name, law in CONTROL_LAWS.items()
        for constant in law.constants()
        if constant not in needed
    ]


def made_of(scenario: "Scenario") -> dict[str, Any]:
    """Return what a result was made from, for its JSON."""
    return {
        "scenario": {"name": scenario.name, **scenario.as_dict()},
        "overrides": list(scenario.overrides),
        "versions": versions(),
    }


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


def seconds(text: str) -> float:
    """Parse a time in seconds: finite, zero or more."""
    return _not_negative(text, "a time in seconds")


def speed(text: str) -> float:
    """Parse a speed in m/s: finite, zero or more."""
    return _not_negative(text, "a speed in m/s")


def length(text: str) -> float:
    """Parse a length in m: finite, above zero."""
    value = _not_negative(text, "a length in m")
    if value == 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a length in m above 0")
    return value


def velocity(text: str) -> float:
    """Parse a velocity in m/s: finite."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a velocity in m/s")
    return value


def _not_negative(text: str, what: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not (isfinite(value) and value >= 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}, 0 or more")
    return value
