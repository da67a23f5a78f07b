"""JSON as we accept it: one object of plain JSON, each key once, every number finite."""

from __future__ import annotations

import json
import math
from collections import Counter
from typing import Any

from semmap_log.interop.formats.parsing.problems import shown

MOST_LINE_BYTES = 16 * 2**20
"""Enough for a large floor plan: its cells are packed."""
MOST_COMMAS = 2**18
"""So many values take some 60 MB once they are read; no event has a hundred."""
MOST_DIGITS = 400


class StrictJsonError(ValueError):
    """Not the JSON that is accepted; the one who knows the line says where."""


def load_object(text: str | bytes) -> dict[str, Any]:
    """Return the one JSON object in the text.

    Raises:
        StrictJsonError: It is not one, or holds what we do not accept.
    """
    if len(text) > MOST_LINE_BYTES:
        raise StrictJsonError(f"expected a line of at most {MOST_LINE_BYTES // 2**20} MiB")
    commas = text.count(b",") if isinstance(text, bytes) else text.count(",")
    if commas > MOST_COMMAS:
        raise StrictJsonError(f"expected at most {MOST_COMMAS:,} commas in a line, got {commas:,}")
    try:
        decoded = text.decode("utf-8-sig") if isinstance(text, bytes) else text
        value = json.loads(
            decoded,
            object_pairs_hook=_each_once,
            parse_constant=_reject_constant,
            parse_float=_finite,
            parse_int=_short,
        )
    except StrictJsonError:
        raise
    except RecursionError:
        raise StrictJsonError("expected one JSON object, got values nested without end") from None
    except UnicodeDecodeError as error:
        raise StrictJsonError(
            f"expected UTF-8 text, got byte 0x{error.object[error.start]:02x}"
        ) from None
    except json.JSONDecodeError as error:
        raise StrictJsonError(
            f"expected one JSON object a line: {error.msg}, at character {error.pos + 1}"
        ) from None
    except ValueError as error:
        raise StrictJsonError(f"expected one JSON object a line: {error}") from None
    if not isinstance(value, dict):
        raise StrictJsonError(f"expected a JSON object, got {shown(value)}")
    return value


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        twice, _ = Counter(key for key, _ in pairs).most_common(1)[0]
        raise StrictJsonError(f"key {shown(twice)} is there twice; keep one of them")
    return values


def _reject_constant(name: str) -> float:
    raise StrictJsonError(f"expected a finite number, got {name}; write null where it is not known")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise StrictJsonError(f"expected a number below 1.8e308, got {shown(text)}")
    return value


def _short(text: str) -> int:
    if len(text) > MOST_DIGITS:
        raise StrictJsonError(f"expected a number of at most {MOST_DIGITS} digits, got {len(text)}")
    return int(text)
