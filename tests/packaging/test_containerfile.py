"""The Containerfile takes the steps of docs/installing.md, which the tests of the docs run."""

import json
import re
from pathlib import Path

SOURCE = Path(__file__).parents[2]
IGNORED = {line.rstrip("*") for line in (SOURCE / ".dockerignore").read_text().split()}


def instructions() -> list[tuple[str, str]]:
    """Names and arguments, of a file without continued lines and here-documents."""
    lines = (SOURCE / "Containerfile").read_text().splitlines()
    return [(line.partition(" ")[0], line.partition(" ")[2]) for line in lines if line[:1] != "#"]


def steps_of_the_docs() -> list[str]:
    text = (SOURCE / "docs" / "installing.md").read_text()
    section = text.partition("## Into a colcon workspace")[2]
    lines = section.partition("```sh\n")[2].partition("```")[0].splitlines()
    return [re.sub(r"\s+#.*", "", line).removeprefix("sudo ") for line in lines]


def test_its_steps_are_those_of_the_docs() -> None:
    steps = [
        part.replace(" --yes", "")
        for name, argument in instructions()
        if name == "RUN"
        for part in argument.split(" && ")
        if part != "apt-get update"
    ]
    others = ("mkdir ", "cp ", "cd ", ". install", "stickslip ", "ros2 ")
    expected = [step for step in steps_of_the_docs() if not step.startswith(others)]
    # Each step has a shell of its own, so that ROS is sourced where it is needed.
    setup = ". /opt/ros/jazzy/setup.bash"
    assert setup in expected
    assert steps.index(setup) == steps.index("venv/bin/python -m colcon build") - 1
    assert [s for s in steps if s != setup] == [s for s in expected if s != setup]


def test_its_instructions_are_in_order_and_copy_the_sources_alone() -> None:
    names = [name for name, _ in instructions()]
    assert names[:3] == ["FROM", "SHELL", "WORKDIR"]
    assert names[-2:] == ["ENTRYPOINT", "CMD"]
    assert {*names[3:-2]} == {"RUN", "COPY"}
    arguments = dict(instructions())
    assert arguments["COPY"] == ". src/stickslip_ros"
    *shell, start, _ = json.loads(arguments["ENTRYPOINT"])
    assert shell == json.loads(arguments["SHELL"])
    assert start == '. install/setup.bash && exec "$@"'
    assert json.loads(arguments["CMD"])[0] in "".join(steps_of_the_docs())
    ignored = (SOURCE / ".gitignore").read_text().split()
    assert {".git"} | IGNORED <= {".git"} | {line.strip("/*") for line in ignored}
