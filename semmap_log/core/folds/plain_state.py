"""States of plain values and numpy arrays as bytes, and back: safe on a file from anywhere.

A line of JSON holds the values, and .npy bodies (never pickled) after it the arrays. Reading
returns the exact types that were written; a state of anything else is an error.
"""

from __future__ import annotations

import io
import json
from collections import Counter
from typing import Any

import numpy as np

from semmap_log.errors import CheckpointError

_AS_THEY_ARE = (type(None), bool, int, float, str)
_SEQUENCES: dict[str, type[Any]] = {
    "list": list,
    "tuple": tuple,
    "set": set,
    "frozenset": frozenset,
}
_MAPPINGS: dict[str, type[Any]] = {"dict": dict, "Counter": Counter}
MOST_DTYPE_CHARACTERS = 100_000
"""Limit for a structured array's fields in words: numpy's own default is lower."""


def dump_plain(state: Any) -> bytes:
    """Return a state as bytes.

    Raises:
        CheckpointError: It holds something else than plain values and arrays of them.
    """
    arrays: list[Any] = []
    out = io.BytesIO()
    try:
        out.write(json.dumps(_tree(state, arrays, "the state")).encode() + b"\n")
        for array in arrays:
            np.lib.format.write_array(out, array, allow_pickle=False)
    except (ValueError, RecursionError) as error:  # arrays of objects, a state that holds itself
        raise CheckpointError(f"the state cannot be stored: {error}; {_WAY_OUT}") from None
    return out.getvalue()


def load_plain(data: bytes) -> Any:
    """Return the state that `dump_plain` made these bytes of.

    Raises:
        ValueError: They are not of its making.
    """
    source = io.BytesIO(data)
    try:
        tree, arrays = json.loads(source.readline()), []
        while source.tell() < len(data):
            arrays.append(
                np.lib.format.read_array(
                    source, allow_pickle=False, max_header_size=MOST_DTYPE_CHARACTERS
                )
            )
        return _state(tree, arrays)
    except (LookupError, TypeError, MemoryError, RecursionError) as error:
        raise ValueError(f"not a stored state: {error}") from None


def _tree(value: Any, arrays: list[Any], where: str) -> Any:
    """Return a value as JSON knows it: a plain one as it is, all others as [what, content]."""
    cls = type(value)
    if cls in _AS_THEY_ARE:
        return value
    if cls is bytes:
        return ["bytes", value.hex()]
    if cls is np.ndarray or isinstance(value, np.generic):
        arrays.append(np.asarray(value))
        return ["array" if cls is np.ndarray else "scalar", len(arrays) - 1]
    if cls.__name__ in _SEQUENCES and cls is _SEQUENCES[cls.__name__]:
        items = value if cls in (list, tuple) else sorted(value, key=repr)
        return [cls.__name__, [_tree(v, arrays, f"{where}[{i}]") for i, v in enumerate(items)]]
    if cls.__name__ in _MAPPINGS and cls is _MAPPINGS[cls.__name__]:
        pairs = value.items()
        return [
            cls.__name__,
            [[_tree(k, arrays, f"a key of {where}"), _tree(v, arrays, f"{where}[{k!r}]")]
             for k, v in pairs],
        ]  # fmt: skip
    raise CheckpointError(
        f"{where} is a {cls.__name__}; expected numbers, texts, lists, tuples, sets, dicts, "
        f"Counters and numpy arrays of these; {_WAY_OUT}"
    )


def _state(tree: Any, arrays: list[Any]) -> Any:
    """Return the value that a tree stands for."""
    if not isinstance(tree, list):
        if type(tree) not in _AS_THEY_ARE:
            raise TypeError(type(tree).__name__)
        return tree
    what, content = tree
    if what == "bytes":
        return bytes.fromhex(content)
    if what == "array":
        return arrays[content]
    if what == "scalar":
        return arrays[content][()]
    if what in _SEQUENCES:
        return _SEQUENCES[what](_state(item, arrays) for item in content)
    return _MAPPINGS[what]({_state(k, arrays): _state(v, arrays) for k, v in content})


_WAY_OUT = "give the projection dump(state) -> bytes and load(bytes) -> state."
