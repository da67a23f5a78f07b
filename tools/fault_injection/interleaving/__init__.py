"""Threads of which one runs at a time, in an order that a seed draws."""
