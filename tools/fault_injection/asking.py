"""What the log's own checks say of a log."""

from __future__ import annotations

from pathlib import Path

GOOD, TORN = 0, 3


def what_verify_says(log: Path, *, is_closed: bool) -> list[str]:
    """Return what `verify` has against a log; a torn tail only counts if it was closed."""
    from semmap_log.log.replay.care import verify

    try:
        found = verify(log)
    except Exception as error:  # noqa: BLE001 - whatever it is, it is the finding
        return [f"verify: {error!r}"]
    if found.exit_code == GOOD or (found.exit_code == TORN and not is_closed):
        return []
    return [f"verify: {[finding.text for finding in found.findings]}"]
