"""Programs that run next to a robot: ROS 1, ROS 2, planners."""
