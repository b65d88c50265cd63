"""What is recorded: topics, messages, bags and tables, without a ROS graph."""

from typing import Literal

TimeSource = Literal["header", "log"]
"""Time of a message: the stamp in it, or when it was recorded."""
ForceSource = Literal["topic", "effort"]
"""Force of another machine: that of a topic, or the effort of the joint."""
