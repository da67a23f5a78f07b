"""The thesis's experiment: does a map of doors help a robot to reach its goals?"""
