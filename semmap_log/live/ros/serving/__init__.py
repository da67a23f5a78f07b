"""The thesis's server: goals in, results and the door map out; ROS only behind `ros_node`."""
