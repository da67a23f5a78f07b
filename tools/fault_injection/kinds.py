"""Which kinds of faults there are: to add one, write its file and name it here."""

from __future__ import annotations

from fault_injection.clocks import clocks
from fault_injection.closed import closed
from fault_injection.costs import costs
from fault_injection.damaged_bytes import cuts, flips
from fault_injection.fault import Kind
from fault_injection.folders import folders
from fault_injection.interleaving.schedules import threads
from fault_injection.interrupts import interrupts
from fault_injection.power_cuts import cuts_on_ext4, cuts_on_xfs
from fault_injection.real_limits import real_limits
from fault_injection.rivals import rivals
from fault_injection.signals import signals
from fault_injection.signed import signed
from fault_injection.simulated_disk import simulated_disk
from fault_injection.syscalls import syscall_errors, syscall_kills
from fault_injection.trimmed import trimmed
from fault_injection.unreadable import shrinking_files, unreadable_sectors

KINDS: dict[str, Kind] = {
    "disk": simulated_disk,
    "syscalls": syscall_kills,
    "errors": syscall_errors,
    "limits": real_limits,
    "power-ext4": cuts_on_ext4,
    "power-xfs": cuts_on_xfs,
    "cuts": cuts,
    "flips": flips,
    "sectors-unreadable": unreadable_sectors,
    "sectors-shrinking": shrinking_files,
    "rivals": rivals,
    "clocks": clocks,
    "interrupts": interrupts,
    "signals": signals,
    "threads": threads,
    "folders": folders,
    "closed": closed,
    "costs": costs,
    "trimmed": trimmed,
    "signed": signed,
}
"""Name on the command line -> the function that tries its faults, in the order of the table."""
