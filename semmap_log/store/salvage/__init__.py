"""Repair on demand: what is whole in a damaged log becomes a log again; the rest is named.

recovery_plan   what would be saved and what is lost
renumbering     event numbers of the old log -> of the new
rewriting       a commit in its new place
trimmed_parts   where something was taken out of what survives
recovered_log   the new log
swap            the new log in the place of the old, which is kept
recovering      all of it
"""

from semmap_log.store.salvage.recovering import Recovered, StateParts, recover, recover_into
from semmap_log.store.salvage.recovery_plan import Loss, RecoveryPlan, plan_recovery

__all__ = [
    "Loss",
    "Recovered",
    "RecoveryPlan",
    "StateParts",
    "plan_recovery",
    "recover",
    "recover_into",
]
