"""The one place that imports rerun; without it, says how to get it."""

from __future__ import annotations

from semmap_log.errors import MissingExtraError

try:
    import rerun as rr
    import rerun.blueprint as rrb
except ImportError:
    raise MissingExtraError("rerun-sdk", "viewer") from None

__all__ = ["rr", "rrb"]
