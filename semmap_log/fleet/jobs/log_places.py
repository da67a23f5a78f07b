"""Which logs are meant: paths and URLs, folders of logs, patterns, and files that list them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path, PurePath

from semmap_log.core.io.object_store import ObjectStore
from semmap_log.core.io.url_path import UrlPath, place_of
from semmap_log.errors import FormatError, NotALogError

MARKS = "*?["
"""Of a pattern: in any part of a path or URL, each for one part."""


def log_places(named: Iterable[str | PurePath]) -> list[str]:
    """Return the logs that are meant, each once, in the order in which they are named.

    Args:
        named: Each a log; a folder or prefix with logs right below it; either with `*`, `?` or
            `[…]`; or `@FILE` with one such a line (`#` begins a comment).

    Raises:
        NotALogError: One of them means none, or is no place.
        FormatError: A list cannot be read.
        LogAccessError: The store or the disk does not let us look.
        MissingExtraError: obstore is not installed.
    """
    found: dict[str, None] = {}
    for text in _lines(named):
        places = list(_meant(text))
        if not places:
            raise NotALogError(f"{text}: expected logs, found none there.")
        found |= dict.fromkeys(str(place) for place in places)
    if not found:
        raise NotALogError("expected at least one log, or a place with logs below it.")
    return list(found)


def _lines(named: Iterable[str | PurePath]) -> Iterator[str]:
    for each in map(str, named):
        if not each.startswith("@"):
            yield each
            continue
        path = Path(each[1:])
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise FormatError(path, f"expected a list of logs, a line each: {error}.") from None
        yield from (line.strip() for line in lines if line.strip()[:1] not in ("", "#"))


def _meant(text: str) -> Iterator[Path | UrlPath]:
    place = place_of(text)
    if any(mark in str(place) for mark in MARKS) and not _is_there(place):
        yield from _matching(place)
        return
    is_log, below = _look(place)
    # Of a place without anything its own error is told, by who asks it.
    yield from (place / name for name in below) if below and not is_log else (place,)


def _is_there(place: PurePath) -> bool:
    return isinstance(place, Path) and place.exists()


def _matching(pattern: Path | UrlPath) -> Iterator[Path | UrlPath]:
    """Yield what a pattern's parts fit, part by part."""
    parts = pattern.parts
    first = next(i for i, part in enumerate(parts) if any(mark in part for mark in MARKS))
    root = type(pattern)(*parts[:first])
    found: list[Path | UrlPath] = [root]
    for part in parts[first:]:
        is_plain = not any(mark in part for mark in MARKS)
        found = [
            place / name
            for place in found
            for name in ([part] if is_plain else _names(place))
            if is_plain or fnmatchcase(name, part)
        ]
    yield from found


def _look(place: Path | UrlPath) -> tuple[bool, Sequence[str]]:
    """Tell whether a log lies right there, and name the folders in which others may.

    Of a web server it is believed.
    """
    if isinstance(place, Path):
        if not place.is_dir() or _has_segments(place):
            return True, []
        return False, [name for name in _names(place) if _has_segments(place / name)]
    if place.scheme in ("http", "https"):
        return True, []
    objects, folders = ObjectStore(place).list_all()
    return any(each.name.endswith(".mcap") for each in objects), folders


def _has_segments(path: Path) -> bool:
    return path.is_dir() and any(path.glob("*.mcap"))


def _names(place: Path | UrlPath) -> Sequence[str]:
    """Return what a pattern can mean: folders; on a disk also zips and joins."""
    if isinstance(place, UrlPath):
        return ObjectStore(place).list_all()[1]
    if not place.is_dir():
        return []
    ends = (".zip", ".join.json")
    return sorted(
        each.name for each in place.iterdir() if each.is_dir() or each.name.endswith(ends)
    )
