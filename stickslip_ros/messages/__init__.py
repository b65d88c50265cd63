"""Topics and messages: names, types and byte layouts, without a ROS graph."""
