"""Where questions are taken: `unix:PATH`, a socket among the files, or `tcp:HOST:PORT`."""

from __future__ import annotations

import contextlib
import fcntl
import ipaddress
import os
import socket
import stat
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from semmap_log.core.io.lock_holders import is_held_by_strangers
from semmap_log.core.texts import command_line
from semmap_log.errors import AddressError

LISTENING = 1024
"""Clients that may wait until they are let in."""

CONNECT_S = 10.0

LOCKED_S = 2.0
"""So long at most a folder is waited for in which a socket is to be."""


@dataclass(frozen=True, slots=True)
class UnixAddress:
    """A socket among the files."""

    path: Path

    def __str__(self) -> str:
        return f"unix:{self.path}"

    def connect(self) -> socket.socket:
        """Return a connection to who listens there.

        Raises:
            AddressError: Nobody does.
        """
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            _connect_unix(connection, self.path)
        except OSError as error:
            connection.close()
            raise _nobody(self, error) from error
        return connection


@dataclass(frozen=True, slots=True)
class TcpAddress:
    """A port of a machine."""

    host: str
    port: int

    def __str__(self) -> str:
        return (
            f"tcp:[{self.host}]:{self.port}" if ":" in self.host else f"tcp:{self.host}:{self.port}"
        )

    def connect(self) -> socket.socket:
        """Return a connection to who listens there.

        Raises:
            AddressError: Nobody does.
        """
        try:
            connection = socket.create_connection((self.host, self.port), CONNECT_S)
        except (OSError, UnicodeError) as error:  # of a name that no host can have
            raise _nobody(self, error) from error
        connection.settimeout(None)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection


Address = UnixAddress | TcpAddress


def read_address(text: str) -> Address:
    """Return the address that a text means.

    Raises:
        AddressError: It is none.
    """
    kind, colon, rest = text.partition(":")
    if kind == "unix" and rest:
        return UnixAddress(Path(rest))
    host, port_colon, port = rest.rpartition(":")
    host = host[1:-1] if host.startswith("[") and host.endswith("]") else host
    if kind == "tcp" and colon and port_colon and host and _is_port(port):
        return TcpAddress(host, int(port))
    raise AddressError(
        f"expected an address such as unix:/run/doors.sock or tcp:127.0.0.1:5300, got {text!r}."
    )


def _is_port(text: str) -> bool:
    return text.isascii() and text.isdecimal() and int(text[:6]) < 2**16


@dataclass(slots=True)
class Listener:
    """A socket that takes connections."""

    socket: socket.socket
    address: Address
    """With the port that was chosen, if any port would do."""
    _file: tuple[int, int] | None = None

    def close(self) -> None:
        """Take no more; remove the file, unless another has taken its place."""
        file, self._file = self._file, None  # closed again, it must not take another's for ours
        with self.socket:  # closed last: until then no other file gets the same number
            if file is None or not isinstance(self.address, UnixAddress):
                return
            if _file_id(self.address.path) == file:
                self.address.path.unlink(missing_ok=True)


def listen(address: Address, *, any_host: bool = False) -> Listener:
    """Listen at an address; a Unix socket's file is for its owner alone.

    Args:
        address: Where; port 0: any that is free.
        any_host: Whether the host may be another than the machine itself.

    Raises:
        AddressError: Somebody listens there, there is a file of another kind, the host may not be
            listened at, or the system says no.
    """
    try:
        if isinstance(address, UnixAddress):
            return _listen_unix(address)
        return _listen_tcp(address, any_host=any_host)
    except (OSError, UnicodeError) as error:
        if isinstance(error, AddressError):
            raise
        raise AddressError(f"{address}: cannot be listened at: {reason_of(error)}.") from error


def _listen_unix(address: UnixAddress) -> Listener:
    """Listen at a path: the file of a server that was killed is replaced, and no other."""
    path = address.path.absolute()
    with _alone_in(path.parent):
        _make_room(path)
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            listener.bind(str(address.path))  # as given: an absolute one may be too long
            path.chmod(0o600)  # before it listens: until then nobody is let in
            listener.listen(LISTENING)
        except OSError:
            listener.close()
            raise
        return Listener(listener, UnixAddress(path), _file_id(path))


@contextlib.contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Let no other server replace a file of the folder meanwhile: it might be ours."""
    held = os.open(folder, os.O_RDONLY)
    try:
        _lock(held, folder)
        yield
    finally:
        os.close(held)


def _lock(held: int, folder: Path) -> None:
    """Lock a folder; it is held for a moment by other servers, and for ever by a log's writer.

    A stranger who may only read the folder cannot put a socket there: that lock keeps nobody out.

    Raises:
        AddressError: It stays locked.
    """
    end_s = time.monotonic() + LOCKED_S
    while not _takes_lock(held) and not is_held_by_strangers(held, held):
        if time.monotonic() > end_s:
            raise AddressError(
                f"{folder}: another program has locked this folder, as who writes a log locks "
                "the log's; give a path in another folder."
            )
        time.sleep(0.01)


def _takes_lock(held: int) -> bool:
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _make_room(path: Path) -> None:
    """Remove a socket at which nobody listens.

    Raises:
        AddressError: There is something else.
    """
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    if not stat.S_ISSOCK(mode):
        raise AddressError(
            f"{path}: expected no file, or a socket, got something else; nothing done."
        )
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(CONNECT_S)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return
        except OSError:  # full, or not ours to ask: somebody is there
            pass
    raise AddressError(f"{path}: another server listens there; stop it, or give another path.")


def _listen_tcp(address: TcpAddress, *, any_host: bool) -> Listener:
    family, _, _, _, place = socket.getaddrinfo(
        address.host, address.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    host = str(place[0])
    if not (any_host or ipaddress.ip_address(host.partition("%")[0]).is_loopback):
        raise AddressError(
            f"{address}: anybody who can reach this machine could set its doors; expected "
            "127.0.0.1, or --ask-any-host with a --token-file."
        )
    listener = socket.create_server((host, place[1]), family=family, backlog=LISTENING)
    return Listener(listener, TcpAddress(host, listener.getsockname()[1]))


def _file_id(path: Path) -> tuple[int, int] | None:
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


def _connect_unix(connection: socket.socket, path: Path) -> None:
    """Connect; if many wait to be accepted, wait for our turn.

    Raises:
        OSError: Nobody listens, or lets us in in time.
    """
    end_s = time.monotonic() + CONNECT_S
    connection.setblocking(False)
    while True:
        try:
            connection.connect(str(path))
            break
        except BlockingIOError:
            if time.monotonic() > end_s:
                raise
            time.sleep(0.005)
    connection.setblocking(True)


def _nobody(address: Address, error: OSError | UnicodeError) -> AddressError:
    return AddressError(
        f"{address}: no server answers there: {reason_of(error)}. To serve a log there: "
        f"{command_line('serve', 'LOG', '--ask', str(address))}"
    )


def reason_of(error: OSError | UnicodeError) -> str:
    """Return why an address cannot be reached or listened at, in words."""
    if isinstance(error, UnicodeError):
        return "no host can have such a name"
    return str(error.strerror or error)
