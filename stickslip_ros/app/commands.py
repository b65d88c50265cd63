"""The commands by name: the group that `--help` shows them in, and what each does in one line."""

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
    "stability": ("Analyze", "compute equilibrium, Hopf speeds, limit cycles and critical gains"),
    "design": ("Design", "propose controller gains that suppress the vibration"),
    "list": ("Scenarios", "list scenarios, friction laws and nodes"),
    "show": ("Scenarios", "show every parameter of a scenario and where its value comes from"),
    "new": ("Scenarios", "write a complete, commented scenario file to edit"),
    "schema": ("Scenarios", "print the JSON schema of scenario files, for editors"),
    "paper": ("Paper", "reproduce the figures and the claims of the paper"),
    "completion": ("Shell", "print the completion script for bash or zsh"),
}
