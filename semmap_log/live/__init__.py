"""Programs that run next to a robot: ROS 1, ROS 2, planners.

May import the rooms below; rospy and rclpy are imported in `ros/` only. Start with
`ros/serving/` (the server of doors) and `planners/oracle.py` (the answers to planners).
`robot_files/` is what a robot's workspace gets.
"""
