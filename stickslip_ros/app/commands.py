"""The commands: their names, groups, examples and parsers."""

import argparse
from importlib import import_module

from typing_extensions import override

from stickslip_ros.app.output import coloured

COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("Run", "run a scenario as ROS 2 nodes, record it and report the results"),
    "dashboard": ("Run", "show a running loop on a web page and control it there"),
    "set": ("Run", "set a parameter of a running node"),
    "replay": ("Run", "publish the messages of a bag again, with their recorded spacing"),
    "simulate": ("Simulate and study", "simulate a scenario without ROS and measure its motion"),
    "sweep": ("Simulate and study", "measure the settled motion over one parameter or two"),
    "basin": ("Simulate and study", "find the motion that each initial state leads to"),
    "report": ("Analyze", "measure a recorded run, or compare several"),
    "repair": ("Analyze", "write a sound bag from one that is cut off or damaged"),
    "identify": ("Analyze", "fit a model with intervals to recordings of a machine"),
    "margin": ("Analyze", "tell from runs that do not vibrate at which feed vibration starts"),
    "stability": ("Analyze", "compute equilibrium, critical speeds and gains, and limit cycles"),
    "design": ("Design", "propose controller gains that suppress the vibration"),
    "compare": ("Design", "compare control laws: which one holds the drive, with what force"),
    "export": ("Design", "write a control law as C or Structured Text, for a drive"),
    "list": ("Scenarios", "list the scenarios, friction laws and control laws"),
    "show": ("Scenarios", "show every parameter of a scenario and where its value comes from"),
    "new": ("Scenarios", "write a commented scenario file to edit"),
    "schema": ("Scenarios", "print the JSON schema of scenario files, for editors"),
    "completion": ("Shell", "print the completion script for bash or zsh"),
}
"""Group in the overview, and what a command does, by name; each has a module of its name."""

EXAMPLES: dict[str, str] = {
    "run": "stickslip run feed_drive --duration 10 --dashboard",
    "dashboard": "stickslip dashboard --namespace feed_drive",
    "set": "stickslip set plant.belt_speed=0.03 plant.damping=200",
    "replay": "stickslip replay bags/reference --rate 2",
    "simulate": "stickslip simulate feed_drive -p plant.belt_speed=0.03 --duration 10",
    "sweep": "stickslip sweep paper --no-control --over plant.belt_speed=0.02:0.6:300 "
    "--plot diagram.png",
    "basin": "stickslip basin paper --position=-2:2:20 --velocity=-2:2:20 --plot basin.png",
    "report": "stickslip report bags/before bags/after --plot compared.png",
    "repair": "stickslip repair bags/killed bags/sound",
    "identify": "stickslip identify log.mat --columns time=t,position=q,force=u*35.15 "
    "--out identified.yaml",
    "margin": "stickslip margin bags/60 bags/55 bags/50 --plot margin.png",
    "stability": "stickslip stability feed_drive --plot map.png",
    "design": "stickslip design feed_drive --belt-speed 0.01:0.05 --out designed.yaml",
    "compare": "stickslip compare feed_drive --controllers washout,pid,sliding_mode "
    "--over plant.belt_speed=0.01:0.04:4 --seeds 20 --spread 0.2 --workers 2 --html compared.html",
    "export": "stickslip export designed.yaml --out washout.c",
    "list": "stickslip list",
    "show": "stickslip show feed_drive",
    "new": "stickslip new my_drive.yaml --from feed_drive",
    "schema": "stickslip schema > scenario.schema.json",
    "completion": 'eval "$(stickslip completion bash)"',
}
"""An example of each command, at the end of its help."""

_OPTIONS = {
    "-h, --help": "show this help, or that of a command: stickslip COMMAND --help",
    "--version": "show the versions of this package and of what it uses",
}


def overview() -> str:
    """Return the help of the program: its commands by group."""
    width = max(map(len, (*COMMANDS, *_OPTIONS))) + 2
    groups: dict[str, list[str]] = {}
    for name, (group, meaning) in COMMANDS.items():
        groups.setdefault(group, []).append(f"  {name:{width}}{meaning}")
    groups["Options"] = [f"  {name:{width}}{meaning}" for name, meaning in _OPTIONS.items()]
    parts = [
        "usage: stickslip COMMAND [OPTION ...]",
        "Simulate the stick-slip vibration of a feed drive, control it and measure it.",
        *("\n".join([f"{group}:", *lines]) for group, lines in groups.items()),
        "A first example: stickslip simulate feed_drive",
    ]
    return coloured("\n\n".join(parts))


class _Parser(argparse.ArgumentParser):
    @override
    def format_help(self) -> str:
        return coloured(super().format_help())


def command_parser(name: str) -> argparse.ArgumentParser:
    """Return the parser of a command; only the module of this one is imported."""
    command = import_module(f"stickslip_ros.app.{name}")
    example = f"example: {EXAMPLES[name]}" if name in EXAMPLES else None
    parser = _Parser(prog=f"stickslip {name}", description=COMMANDS[name][1], epilog=example)
    command.add_arguments(parser)
    parser.add_argument(
        "--quiet", action="store_true", help="print results and errors only: no progress, no notes"
    )
    parser.set_defaults(command=name, run=command.run)
    return parser
