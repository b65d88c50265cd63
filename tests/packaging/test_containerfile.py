"""The Containerfile takes the steps of docs/installing.md, which the tests of the docs run."""

import re
from pathlib import Path

SOURCE = Path(__file__).parents[2]


def steps_of_the_docs() -> list[str]:
    text = (SOURCE / "docs" / "installing.md").read_text()
    section = text.partition("## Into a colcon workspace")[2]
    lines = section.partition("```sh\n")[2].partition("```")[0].splitlines()
    return [re.sub(r"\s+#.*", "", line).removeprefix("sudo ") for line in lines]


def test_its_steps_are_those_of_the_docs() -> None:
    commands = re.findall("^RUN (.*)$", (SOURCE / "Containerfile").read_text(), re.MULTILINE)
    parts = [part.replace(" --yes", "") for command in commands for part in command.split(" && ")]
    steps = [part for part in parts if part != "apt-get update"]
    others = ("mkdir ", "cp ", "cd ", ". install", "stickslip ", "ros2 ")
    expected = [step for step in steps_of_the_docs() if not step.startswith(others)]
    # Each step has a shell of its own, so that ROS is sourced where it is needed.
    setup = ". /opt/ros/jazzy/setup.bash"
    assert setup in expected
    assert steps.index(setup) == steps.index("venv/bin/python -m colcon build") - 1
    assert [s for s in steps if s != setup] == [s for s in expected if s != setup]
