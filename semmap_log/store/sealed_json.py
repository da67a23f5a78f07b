"""A JSON object that carries the SHA-256 of its other entries: a changed one is noticed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from semmap_log.store.form import DIGEST_KEY


def sealed(entries: Mapping[str, Any]) -> str:
    """Return the text of entries, their digest behind them."""
    return json.dumps({**entries, DIGEST_KEY: _digest(entries)}) + "\n"


def unsealed(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of an object that was read, without the digest.

    Raises:
        ValueError: The digest does not fit them.
        KeyError: There is none.
    """
    entries = dict(found)
    if entries.pop(DIGEST_KEY) != _digest(entries):
        raise ValueError("its digest does not fit it")
    return entries


def _digest(entries: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()
