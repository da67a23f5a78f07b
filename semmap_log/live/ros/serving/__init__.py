"""The thesis's server: goals in, results and the door map out; ROS only after `ros_node`."""
