"""Plots by matplotlib; `sdk` is the only place that imports it."""
