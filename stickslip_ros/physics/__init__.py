"""Physics: model, motion, measures, sampled loop and theory. No ROS, no files, no clock."""
