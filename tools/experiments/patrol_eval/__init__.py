"""Patrols of a building whose doors live by hidden schedules: what a planner makes of them."""
