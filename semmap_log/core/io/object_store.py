"""Objects in a store: S3 and its like, Google's, Azure's, or a plain web server to read from.

The one place that imports obstore. Credentials come from the store's own environment and files
(AWS_ACCESS_KEY_ID, AWS_ENDPOINT_URL, GOOGLE_APPLICATION_CREDENTIALS, AZURE_STORAGE_ACCOUNT_NAME …);
none of them is ever in a URL, a message, or a log.
"""

from __future__ import annotations

import os
import re
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from semmap_log import errors
from semmap_log.core.io.bounded_requests import MOST_GROWTH_BYTES, answer_of, check_not_forked
from semmap_log.core.io.url_path import UrlPath

if TYPE_CHECKING:
    from typing_extensions import Buffer

T = TypeVar("T")

PATIENCE_S = 60.0
"""A request is tried again for so long: the network, 429, 5xx, answers that are cut."""
REQUEST_S = 30.0
MOST_TRIES = 8
_LIST_TRIES = 2
"""For a web server's list, which many do not know, and say so as if they were ill (501)."""
_CUT_TRIES = 3
"""For an answer that ends before its end."""
_CHUNK_BYTES = 2**20
"""An object comes in chunks of so many bytes, which are counted."""
_GROWTH_WHILE_READING = 2**29
"""Of memory, during a request for a part: other threads take up parts of objects meanwhile."""


@dataclass(frozen=True, slots=True)
class ObjectStatus:
    """What a store says of an object."""

    name: str
    size: int
    e_tag: str
    """Another for other bytes."""
    modified_ns: int = field(default=0, compare=False)
    """When it was put, by the store's clock, nanoseconds UTC; 0: it was not requested."""


class ObjectStore:
    """The objects right below a URL."""

    def __init__(self, url: UrlPath, *, patience_s: float = PATIENCE_S) -> None:
        """Name a place in a store; nothing is requested yet.

        Args:
            url: Of the folder.
            patience_s: A request is tried again for so long.

        Raises:
            MissingExtraError: obstore is not installed.
            LogAccessError: The URL, or the environment, is none that the store takes.
        """
        self.url = url
        self.place = f"{url} {_endpoint(url)}"
        """What distinguishes it from another store of the same URL."""
        try:
            import obstore
            from obstore.store import from_url
        except ImportError as error:
            raise errors.MissingExtraError("obstore", "fleet") from error
        self._obstore: Any = obstore
        request_s = min(REQUEST_S, patience_s)
        self._within_s = patience_s + 2 * REQUEST_S

        def opened(most_tries: int) -> Any:
            return from_url(
                str(url),
                client_options={
                    "timeout": timedelta(seconds=request_s),
                    "connect_timeout": timedelta(seconds=min(10.0, request_s)),
                    "allow_http": _may_be_plain(url),
                },
                retry_config={
                    "max_retries": most_tries,
                    "retry_timeout": timedelta(seconds=patience_s),
                },
            )

        self._store: Any = self._asked("", lambda: opened(MOST_TRIES))
        self._lister: Any = (
            self._asked("", lambda: opened(_LIST_TRIES)) if self.is_web_server else self._store
        )

    def __reduce__(self) -> tuple[type[ObjectStore], tuple[UrlPath]]:
        """Return what another process opens it by."""
        return type(self), (self.url,)

    @property
    def is_web_server(self) -> bool:
        """Whether it is one, which need not list what it has."""
        return self.url.scheme in ("http", "https")

    def list(self) -> list[ObjectStatus]:
        """Return what lies right below the URL, by name; of a web server that lists nothing: none.

        Raises:
            LogAccessError: The store does not let us.
        """
        return [*self.list_all()[0]]

    def list_all(self) -> tuple[Sequence[ObjectStatus], Sequence[str]]:
        """Return the same, and the names of what has objects below it, in order, by one request.

        Raises:
            LogAccessError: The store does not let us.
        """
        found = self._listed()
        objects = [_status(each, each["path"].rsplit("/", 1)[-1]) for each in found["objects"]]
        folders = (str(each).rstrip("/").rsplit("/", 1)[-1] for each in found["common_prefixes"])
        return sorted(objects, key=lambda status: status.name), sorted(folders)

    def _listed(self) -> Any:
        server = self.url.parts[1]
        nothing: dict[str, Any] = {"objects": [], "common_prefixes": []}
        if self.is_web_server and server in _list_nothing:
            return nothing

        def look() -> Any:
            return self._answer(lambda: self._obstore.list_with_delimiter_async(self._lister))

        try:
            return self._asked("", look)
        except errors.LogAccessError as error:
            status = _status_in(str(error))
            if self.is_web_server and _is_no_list(status):
                _list_nothing.add(server)
                return nothing
            if status == 404:
                raise errors.LogAccessError(f"{self.url}: the bucket does not exist.") from None
            raise

    def status(self, name: str) -> ObjectStatus:
        """Return the store's description of an object.

        Raises:
            FileNotFoundError: There is no such object.
            LogAccessError: The store refuses.
        """

        def head() -> Any:
            return self._answer(lambda: self._obstore.head_async(self._store, name))

        return _status(self._asked(name, head), name)

    def whole(
        self, name: str, unlike: str = "", *, most_bytes: int
    ) -> tuple[bytes, ObjectStatus] | None:
        """Return an object; None: it is unchanged.

        Args:
            name: Its own.
            unlike: The tag that it had; empty: return it in any case.
            most_bytes: A longer one is not what it should be; no more is read of any.

        Raises:
            FileNotFoundError: There is no such object.
            CorruptLogError: It is longer.
            LogAccessError: The store does not let us.
        """
        options = {"if_none_match": unlike} if unlike else {}

        async def get() -> tuple[bytes, ObjectStatus]:
            got = await self._obstore.get_async(self._store, name, options=options)
            status = _status(got.meta, name)
            if status.size > most_bytes:
                problem = f"expected at most {most_bytes:,} bytes, got {status.size:,}"
                raise errors.CorruptLogError(self.url / name, None, problem)
            return await self._body(got, name, status.size), status

        def answer() -> tuple[bytes, ObjectStatus] | None:
            try:
                return self._answer(get, most_bytes=MOST_GROWTH_BYTES + 2 * most_bytes)
            except self._obstore.exceptions.NotModifiedError:
                return None

        return self._asked(name, answer)

    def part(self, status: ObjectStatus, start: int, end: int) -> bytes:
        """Return bytes of an object, which must still be that object.

        Raises:
            FileNotFoundError: It is gone.
            ObjectChangedError: Another has its name.
            LogAccessError: The store refuses, or its answer is not what was requested.
        """
        options: dict[str, object] = {}
        if (start, end) != (0, status.size):  # some servers know no ranges
            options["range"] = (start, end)
        if status.e_tag:
            options["if_match"] = status.e_tag

        async def get() -> bytes:
            got = await self._obstore.get_async(self._store, status.name, options=options)
            if got.meta["size"] != status.size:
                raise errors.ObjectChangedError(self._changed(status.name))
            return await self._body(got, status.name, end - start)

        def answer() -> bytes:
            return self._answer(get, most_bytes=_GROWTH_WHILE_READING)

        for _ in range(_CUT_TRIES):
            data: bytes = self._asked(status.name, answer)
            if len(data) == end - start:
                return data
        raise errors.LogAccessError(
            f"{self.url / status.name}: expected bytes {start} to {end}, but the store sent "
            f"{len(data)}; try again, or use another route to the store."
        )

    def create(self, name: str, data: Buffer | os.PathLike[str]) -> bool:
        """Put an object where none is, and return whether that was done; False: one exists.

        Raises:
            LogAccessError: The store refuses.
        """
        return self._put(name, data, "create")

    def replace(self, name: str, data: bytes, e_tag: str) -> bool:
        """Replace an object, and return whether that was done.

        Args:
            name: Its own.
            data: What it is to be.
            e_tag: Of the one that it replaces; False is returned where another is there by now.

        Raises:
            LogAccessError: The store does not let us.
        """
        return self._put(name, data, {"e_tag": e_tag})

    def remove(self, name: str) -> None:
        """Remove an object.

        Raises:
            LogAccessError: The store does not let us.
        """

        def delete() -> None:
            self._answer(lambda: self._obstore.delete_async(self._store, name))

        self._asked(name, delete)

    def _put(self, name: str, data: Buffer | os.PathLike[str], mode: object) -> bool:
        exceptions = self._obstore.exceptions

        def put() -> bool:
            try:
                self._answer(
                    lambda: self._obstore.put_async(self._store, name, data, mode=mode),
                    most_bytes=MOST_GROWTH_BYTES + _room_for(data),
                )
            except (exceptions.AlreadyExistsError, exceptions.PreconditionError):
                return False
            return True

        try:
            return self._asked(name, put)
        except FileNotFoundError:
            raise errors.LogAccessError(
                f"{self.url / name}: the bucket does not exist; create it first."
            ) from None

    def _answer(
        self, request: Callable[[], Awaitable[T]], *, most_bytes: int = MOST_GROWTH_BYTES
    ) -> T:
        return answer_of(request, within_s=self._within_s, most_bytes=most_bytes)

    async def _body(self, got: Any, name: str, size: int) -> bytes:
        """Return the bytes of an object that come; fewer where they end before.

        Raises:
            LogAccessError: More come than were requested.
        """
        chunks, come = [], 0
        async for chunk in got.stream(min_chunk_size=min(size, _CHUNK_BYTES)):
            chunks.append(chunk)
            come += len(chunk)
            if come >= size:
                break
        if come > size:
            raise errors.LogAccessError(
                f"{self.url / name}: expected {size:,} bytes, got more: the store sends what was "
                "not requested. Read the object in another way."
            )
        return chunks[0] if len(chunks) == 1 else b"".join(chunks)

    def _asked(self, name: str, request: Callable[[], T]) -> T:
        """Return what a request returns; its errors are ours.

        Raises:
            FileNotFoundError: There is no such object.
            ObjectChangedError: It is another than it was.
            LogError: As the request says.
            LogAccessError: Anything else.
        """
        check_not_forked(self.url)
        where = self.url / name if name else self.url
        exceptions = self._obstore.exceptions
        try:
            return request()
        except errors.LogError:
            raise
        except FileNotFoundError:
            raise FileNotFoundError(2, "no such object", str(where)) from None
        except exceptions.PreconditionError:
            raise errors.ObjectChangedError(self._changed(name)) from None
        except (exceptions.PermissionDeniedError, exceptions.UnauthenticatedError) as error:
            raise errors.LogAccessError(
                f"{where}: the store refuses: {_said(error)}. Who may read comes from the store's "
                "own environment or files, for S3 AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY."
            ) from None
        except (exceptions.BaseError, ValueError, OSError) as error:
            raise errors.LogAccessError(
                f"{where}: the store cannot be reached: {_said(error)}."
            ) from None

    def _changed(self, name: str) -> str:
        return f"{self.url / name}: the object was replaced; reopen the log."


_list_nothing: set[str] = set()
"""Web servers that are known to list nothing: queried once."""


def _status_in(text: str) -> int | None:
    found = re.search(r"status code: (\d{3})", text)
    return int(found[1]) if found else None


def _is_no_list(status: int | None) -> bool:
    """Return whether a web server's answer means that it lists nothing; a 403 will recur."""
    return status == 501 or (status is not None and 400 <= status < 500 and status != 429)


def _status(meta: Any, name: str) -> ObjectStatus:
    modified_ns = int(meta["last_modified"].timestamp()) * 10**9  # stores report seconds
    return ObjectStatus(name, int(meta["size"]), meta["e_tag"] or "", modified_ns)


def _endpoint(url: UrlPath) -> str:
    """Return where the environment says that the stores of a scheme are, without a password."""
    begins = {"s3": "AWS_ENDPOINT", "az": "AZURE_STORAGE", "gs": "GOOGLE_BASE"}.get(url.scheme)
    named = sorted(name for name in os.environ if begins and name.startswith(begins))
    places = [os.environ[name] for name in named if "KEY" not in name and "TOKEN" not in name]
    return re.sub(r"://[^/\s]*@", "://", " ".join(places))


def _room_for(data: Buffer | os.PathLike[str]) -> int:
    """Return how much memory sending an object takes."""
    if isinstance(data, os.PathLike):
        return 2 * Path(data).stat().st_size
    return 2 * memoryview(data).nbytes


def _may_be_plain(url: UrlPath) -> bool:
    """Return whether the user has named a store without TLS."""
    named = [value for name, value in os.environ.items() if name.startswith("AWS_ENDPOINT_URL")]
    allowed = os.environ.get("AWS_ALLOW_HTTP", "").lower() in ("1", "true", "yes")
    return url.scheme == "http" or allowed or any(one.startswith("http://") for one in named)


def _said(error: BaseException) -> str:
    """Return the first line of a store's error, without keys and what a signed URL carries."""
    first = str(error).strip().split("\n", 1)[0]
    first = first.split(": <?xml", 1)[0]
    words = [word.split("?", 1)[0] if "://" in word else word for word in first.split()]
    said = re.sub(r"://[^/\s]*@", "://", " ".join(words))
    for secret in _secrets():
        said = said.replace(secret, "…")
    return said.rstrip(".:")


def _secrets() -> list[str]:
    """Return what the environment has of keys, the longest first."""
    words = ("SECRET", "TOKEN", "KEY", "PASSWORD", "CREDENTIAL")
    found = {
        value
        for name, value in os.environ.items()
        if name.startswith(("AWS_", "AZURE_", "GOOGLE_")) and any(word in name for word in words)
    }
    return sorted((one for one in found if len(one) > 7), key=len, reverse=True)
