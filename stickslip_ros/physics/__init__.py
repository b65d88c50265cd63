"""The motion, the control and the measures; no ROS, no files, no clock."""
