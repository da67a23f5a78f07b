"""A log of doors: replayed, queried, written, trimmed, rewritten and signed. The kernel's face.

`core`, `store` and `log` are the kernel: all that a log is. The packages above it use the nouns of
`core` and the names of this package, and nothing else of `log` or `store`; `fleet` alone sends a
log's files as they lie, through `transport`. `tests/test_structure.py` holds them to that.

Names are loaded when they are first used; `__init__.pyi` has their types.

This package may import `core` and `store`. Start with `door_log/door_log.py` (reading) and
`door_log/door_log_writer.py` (writing); `replay/replay.py` computes a state.
"""

from __future__ import annotations

from semmap_log.core.lazily import lazy_names

_HOMES = {
    "log.door_log.appender": ("Appended",),
    "log.door_log.clock_warnings": ("believable_span", "warn_of_clock"),
    "log.door_log.door_log": ("DoorLog",),
    "log.door_log.door_log_writer": ("About", "DoorLogWriter"),
    "log.door_log.known_past": ("KnownPast", "Validator", "newly_hidden"),
    "log.door_log.opening": ("append", "create"),
    "log.door_log.queries": ("LogPart",),
    "log.door_log.read_log": ("open_any", "read"),
    "log.door_log.summary": ("LogSummary",),
    "log.replay.maintenance": ("copy", "plan_recovery", "recover", "recover_into", "verify"),
    "log.replay.read_model.indexing": ("index",),
    "log.replay.replay": ("Scope",),
    "log.rewritten_log": ("RewrittenLog",),
    "log.signing.background_signer": ("BackgroundSigner",),
    "log.signing.ed25519_sdk": ("SigningKey",),
    "log.signing.log_signing": (
        "Signed",
        "check_before_trimming",
        "make_key",
        "read_key",
        "revoke",
        "sign",
    ),
    "log.signing.signature_folder": ("stamp_newest",),
    "log.signing.signed_log": ("SignedVerification", "verify_signed"),
    "log.signing.statement": ("PublicKey", "read_public_keys"),
    "log.trimming.other_copies": ("copies_next_to", "holds_log", "lock_log", "other_files"),
    "log.trimming.redaction": ("Annotation", "Notes", "Redaction", "Tracks"),
    "log.trimming.repeated_sightings": ("Thinning",),
    "log.trimming.trim_log": ("Retention", "TrimRule", "TrimmedLog", "plan_trimming", "trim_log"),
    "store.compaction": ("Compacted", "compact", "plan_compaction"),
    "store.copying": ("Copied",),
    "store.gone_commands": ("StoredCommand",),
    "store.header": ("LogInfo",),
    "store.pages": ("kinds_mask",),
    "store.reading.following": ("FollowedCommit",),
    "store.reading.window": ("Window",),
    "store.repairing": ("Loss", "Recovered", "RecoveryPlan"),
    "store.verification.findings": ("Finding", "Severity", "Verification"),
}

__all__ = [name for names in _HOMES.values() for name in names]

__getattr__ = lazy_names(__name__, _HOMES)


def __dir__() -> list[str]:
    return __all__
