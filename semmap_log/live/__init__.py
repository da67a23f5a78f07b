"""Programs that run beside a robot: ROS 1, ROS 2, planners."""
