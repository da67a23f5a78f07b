"""Plots by matplotlib; `figures` is the only place that imports it."""
