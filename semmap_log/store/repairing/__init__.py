"""Repair on demand: what is whole in a damaged log becomes a log again; the rest is named.

recovery_plan   what would be saved and what is lost, with what was trimmed from it
rewriting       a commit in its new place, with its new event numbers
recovering      the new log, which replaces the old one; the old one is kept
"""

from semmap_log.store.repairing.recovering import Recovered, StateParts, recover, recover_into
from semmap_log.store.repairing.recovery_plan import Loss, RecoveryPlan, plan_recovery

__all__ = [
    "Loss",
    "Recovered",
    "RecoveryPlan",
    "StateParts",
    "plan_recovery",
    "recover",
    "recover_into",
]
