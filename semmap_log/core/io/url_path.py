"""Where a log lies, as a path: on this machine, or in a store that a URL names."""

from __future__ import annotations

import re
from pathlib import Path, PurePath, PurePosixPath
from urllib.parse import unquote, urlsplit

from semmap_log.core.lazily import late_pattern
from semmap_log.core.texts import command_line
from semmap_log.errors import LogAccessError, NotALogError

SCHEMES = ("s3", "gs", "az", "http", "https")
"""Of stores that are read where they lie; `file` is this machine."""

_URL = late_pattern(r"([A-Za-z][A-Za-z0-9+.-]+):/+(.*)", re.DOTALL)
"""Also of a URL that went through `Path`, which makes one slash of two."""


class UrlPath(PurePosixPath):
    """A URL that is put together and named in messages as a path is.

    Nothing on this machine is found under it: what opens files takes a `Path`.
    """

    __slots__ = ()

    def __str__(self) -> str:
        """Return the URL: a path would make one slash of two."""
        scheme, colon, rest = super().__str__().partition(":/")
        return f"{scheme}://{rest}" if colon else scheme

    @property
    def scheme(self) -> str:
        """What comes before the colon: `s3`."""
        return self.parts[0].rstrip(":")


def local_path(given: str | PurePath) -> Path:
    """Return the path of a log that is to be written.

    Raises:
        LogAccessError: It is a URL.
        NotALogError: It is a URL of another scheme.
    """
    place = place_of(given)
    if isinstance(place, UrlPath):
        raise LogAccessError(
            f"{place}: a log in a store can only be read. Write it on a disk of this machine, and "
            f"send it there: {command_line('ship', 'LOG', place)}"
        )
    return place


def place_of(given: str | PurePath) -> Path | UrlPath:
    """Return the path, or the URL, that a text means.

    An absolute path, or one with `./` before it, is never a URL, whatever its folders are called:
    `Path("./s3:/x")` alone is taken for one, since Python forgets the dot.

    Raises:
        NotALogError: It is a URL of another scheme, or one with a password in it.
    """
    if isinstance(given, UrlPath | Path) and not _URL.match(str(given)):
        return given
    text = str(given)
    found = _URL.match(text)
    if found is None:
        return Path(text)
    scheme, rest = found[1].lower(), found[2]
    if scheme == "file":
        return Path("/" + unquote(rest.removeprefix("localhost/")))
    if scheme not in SCHEMES:
        known = ", ".join(f"{name}://" for name in (*SCHEMES, "file"))
        raise NotALogError(f"{scheme}://…: expected a path, or a URL of {known}.")
    parts = urlsplit(f"{scheme}://{rest}")
    if parts.username is not None or parts.password is not None:
        raise NotALogError(
            f"{scheme}://…@{parts.hostname}: refused: a user or a password in a URL ends up in "
            "logs and histories. Give them by the store's own environment or files."
        )
    if parts.query or parts.fragment:
        raise NotALogError(
            f"{scheme}://{parts.netloc}{parts.path}: expected the URL of a folder, got a part "
            "after `?` or `#`; remove it."
        )
    return UrlPath(f"{scheme}://{parts.netloc}{parts.path}")


def is_http(text: str) -> bool:
    """Return whether it is a URL of a web server."""
    return text.startswith(("http://", "https://"))
