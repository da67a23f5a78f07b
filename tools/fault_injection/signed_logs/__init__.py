"""Signed logs, and what somebody without their keys does to them."""
