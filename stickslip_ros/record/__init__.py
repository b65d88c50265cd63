"""What is recorded: topics, messages, bags and tables, without a ROS graph."""
