"""The ROS namespace of a drive."""

DEFAULT_NAMESPACE = "/feed_drive"
LONGEST_NAMESPACE = 200
"""Characters with which the names of all topics and services are short enough for ROS."""
