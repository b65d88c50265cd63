"""`stickslip completion`: the completion script of a shell."""

import argparse
from collections.abc import Callable, Iterable

from stickslip_ros.app.commands import COMMANDS

ParserOf = Callable[[str], argparse.ArgumentParser]
"""Returns the parser of a command by its name."""

_FILES = ("BAG", "DIR", "FILE", "OUT")
"""Metavars of files and directories."""

_PARAMETERS = ("NODE.PARAMETER=VALUE", "NODE.PARAMETER=A:B:COUNT")

_SCRIPT = """\
# Completion of `stickslip` for bash and zsh; `stickslip completion @SHELL@` prints it.
_stickslip() {
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}
    local command=${COMP_WORDS[1]} name= kind= words= options= positional=
    COMPREPLY=()
    (( COMP_CWORD == 1 )) && command=COMMAND
    case $command in
        COMMAND) options=@COMMANDS@ positional=options ;;
@COMMAND_CASES@
        *) return ;;
    esac
    # bash splits words at "=", zsh does not: NAME=VALUE is completed from `name` and `word`.
    if [[ $word == "=" ]]; then
        name=$before word=
    elif [[ $before == "=" ]]; then
        name=${COMP_WORDS[COMP_CWORD-2]}
    elif [[ $word == *=* ]]; then
        name=${word%%=*} word=${word#*=}
    fi
    if [[ $name == --* ]]; then
        before=$name
    elif [[ -n $name ]]; then
        case $name in
@VALUE_CASES@
        esac
    fi
    if [[ -z $name || $name == --* ]]; then
        case "$command $before" in
@OPTION_CASES@
            *) [[ $word == -* ]] && kind=options || kind=$positional ;;
        esac
    fi
    case $kind in
        options) words=$options ;;
        scenarios) words=@SCENARIOS@ ;;
        parameters) words=@PARAMETERS@ ;;
    esac
    COMPREPLY=($(compgen -W "$words" -- "$word"))
    if [[ $kind == files || $kind == scenarios ]]; then
        local IFS=$'\\n'
        [[ $kind == files ]] && COMPREPLY+=($(compgen -f -- "$word"))
        [[ $kind == scenarios ]] && COMPREPLY+=(
            $(compgen -f -X '!*.y*ml' -- "$word") $(compgen -d -- "$word")
        )
        compopt -o filenames 2>/dev/null
    elif [[ $kind == parameters ]]; then
        compopt -o nospace 2>/dev/null
    fi
    if [[ -n $name && ${COMP_WORDS[COMP_CWORD]} == "$name="* ]]; then
        COMPREPLY=("${COMPREPLY[@]/#/$name=}")
    fi
@SPACE@    return 0
}
complete@NOSPACE@ -F _stickslip stickslip
"""

_SPACE_OF_ZSH = """\
    # zsh has no compopt: the space after a word is part of it.
    [[ -z $kind || $kind == options ]] && COMPREPLY=("${COMPREPLY[@]/%/ }")
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Print a script that completes commands, options, scenarios, parameters and files in a "
        "shell. Evaluate it in the start-up file of the shell, or store it where the shell looks "
        "for completions, such as ~/.local/share/bash-completion/completions/stickslip."
    )
    parser.add_argument("shell", choices=("bash", "zsh"), help="the shell")


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    if arguments.shell == "zsh":
        print("autoload -U +X compinit && compinit\nautoload -U +X bashcompinit && bashcompinit")
    print(_script(arguments.shell, arguments.parser_of), end="")
    return 0


def _script(shell: str, parser_of: ParserOf) -> str:
    from stickslip_ros.scenarios.files import shipped_scenarios
    from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS, NODE_PARAMETERS
    from stickslip_ros.scenarios.template import own_first

    parameters = {
        f"{node}.{parameter.name}": parameter
        for node, model in NODE_PARAMETERS.items()
        for parameter in own_first(model)
    }
    values = {
        name: ("true", "false") if parameter.kind is bool else parameter.choices
        for name, parameter in parameters.items()
    }
    of_commands, of_options = _cases(parser_of)
    parts = {
        "@SHELL@": shell,
        "@SPACE@": _SPACE_OF_ZSH if shell == "zsh" else "",
        "@NOSPACE@": " -o nospace" if shell == "zsh" else "",
        "@COMMANDS@": _words(COMMANDS),
        "@COMMAND_CASES@": "\n".join(of_commands),
        "@OPTION_CASES@": "\n".join(of_options),
        "@VALUE_CASES@": "\n".join(
            f"            {name}) words={_words(choices)} ;;"
            for name, choices in values.items()
            if choices
        ),
        "@LAWS@": _words(CONTROLLER_PARAMETERS),
        "@SCENARIOS@": _words(shipped_scenarios()),
        "@PARAMETERS@": _words(f"{name}=" for name in parameters),
    }
    script = _SCRIPT
    for place, text in parts.items():
        script = script.replace(place, text)
    return script


def _cases(parser_of: ParserOf) -> tuple[list[str], list[str]]:
    """Return the branches of the script for the commands, and for their options with a value."""
    of_commands: list[str] = []
    of_options: list[str] = []
    for name in COMMANDS:
        options: list[str] = []
        positional = ""
        for action in parser_of(name)._actions:  # pyright: ignore[reportPrivateUsage]
            completed = _completed(action)
            options += action.option_strings
            if action.option_strings and action.nargs != 0:
                pattern = " | ".join(f'"{name} {option}"' for option in action.option_strings)
                of_options.append(f"            {pattern}) {completed} ;;")
            elif not action.option_strings and not positional:
                positional = completed.replace("kind=", "positional=")
        of_commands.append(f"        {name}) options={_words(options)} {positional} ;;")
    return of_commands, of_options


def _completed(action: argparse.Action) -> str:
    """Return how the script completes the value of an option or an argument."""
    if action.choices is not None:
        return f"words={_words(action.choices)}"
    if action.metavar in _PARAMETERS:
        return "kind=parameters"
    if action.metavar in ("CONTROLLER", "NAME"):
        return "words=@LAWS@" + (" kind=files" if action.metavar == "CONTROLLER" else "")
    if action.metavar == "SCENARIO":
        return "kind=scenarios"
    return "kind=files" if action.metavar in _FILES else "kind="


def _words(words: Iterable[str]) -> str:
    return f"'{' '.join(words)}'"
