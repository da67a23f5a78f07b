"""Plots by matplotlib; `matplotlib_sdk` is the only place that imports it."""
