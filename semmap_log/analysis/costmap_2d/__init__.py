"""ROS's layered costmap, cell for cell: numpy only. It knows no file, no log, no third party."""
