"""Which kinds of faults there are: to add one, write its file and name it here."""

from __future__ import annotations

from fault_injection.fault import Kind

KINDS: dict[str, Kind] = {}
"""Name on the command line -> the function that tries its faults, in the order of the table."""
