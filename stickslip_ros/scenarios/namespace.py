"""The ROS namespace of a drive."""

DEFAULT_NAMESPACE = "/feed_drive"
LONGEST_NAMESPACE = 200
"""Characters of a namespace with which all topic and service names are short enough for ROS."""
