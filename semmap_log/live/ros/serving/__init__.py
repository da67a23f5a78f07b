"""The thesis's server: goals in, results and the door map out; ROS only through `ros_node`."""
