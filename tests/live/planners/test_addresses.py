"""Where questions are taken: addresses, the socket's file, and who may listen where."""

from __future__ import annotations

import fcntl
import os
import socket
import stat
import threading
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import AddressError
from semmap_log.live.planners import addresses
from semmap_log.live.planners.addresses import TcpAddress, UnixAddress, listen, read_address
from tests.other_process import NOBODY, only_root, other_process


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("unix:/run/doors.sock", UnixAddress(Path("/run/doors.sock"))),
        ("unix:a:b", UnixAddress(Path("a:b"))),
        ("tcp:127.0.0.1:5300", TcpAddress("127.0.0.1", 5300)),
        ("tcp:localhost:0", TcpAddress("localhost", 0)),
        ("tcp:[::1]:65535", TcpAddress("::1", 65535)),
    ],
)
def test_addresses_are_read(text: str, address: object) -> None:
    """Read, and written alike."""
    assert address == read_address(text)
    assert text == str(address)


@pytest.mark.parametrize("text", ["", "unix:", "unix", "tcp:", "tcp:host", "tcp::5300",
                                  "tcp:h:65536", "tcp:h:-1", "tcp:h:x", "/run/s", "udp:h:1",
                                  "tcp:h:99999999999", "tcp:h:²"])  # fmt: skip
def test_what_is_no_address(text: str) -> None:
    """The message shows both forms."""
    with pytest.raises(AddressError, match=r"unix:/run/doors\.sock or tcp:127"):
        read_address(text)


def test_the_file_is_for_its_owner_alone_and_goes_with_the_listener(tmp_path: Path) -> None:
    """Whatever the umask lets through."""
    before = os.umask(0)
    try:
        listener = listen(UnixAddress(tmp_path / "s"))
    finally:
        os.umask(before)

    assert 0o600 == stat.S_IMODE((tmp_path / "s").stat().st_mode)
    listener.close()
    assert [] == list(tmp_path.iterdir())


def test_the_file_of_a_server_that_was_killed_is_replaced(tmp_path: Path) -> None:
    """Nobody listens at it any more."""
    killed = socket.socket(socket.AF_UNIX)
    killed.bind(str(tmp_path / "s"))
    killed.listen()
    killed.close()

    listener = listen(UnixAddress(tmp_path / "s"))

    UnixAddress(tmp_path / "s").connect().close()
    listener.close()


def test_a_server_that_listens_is_left_alone(tmp_path: Path) -> None:
    """Its file stays its own, also when it is too busy to let anybody in."""
    first = listen(UnixAddress(tmp_path / "s"))
    with pytest.raises(AddressError, match="another server listens there"):
        listen(UnixAddress(tmp_path / "s"))
    UnixAddress(tmp_path / "s").connect().close()
    first.close()


@pytest.mark.parametrize("kind", ["file", "folder", "link", "fifo"])
def test_what_is_no_socket_is_never_replaced(tmp_path: Path, kind: str) -> None:
    """Not even a link to a socket, or to nothing."""
    path = tmp_path / "s"
    make = {
        "file": lambda: path.write_text("precious"),
        "folder": path.mkdir,
        "link": lambda: path.symlink_to(tmp_path / "nowhere"),
        "fifo": lambda: os.mkfifo(path),
    }
    make[kind]()
    before = path.lstat()

    with pytest.raises(AddressError, match="expected no file, or a socket"):
        listen(UnixAddress(path))

    assert before.st_ino == path.lstat().st_ino


def test_a_file_that_another_has_put_there_is_not_removed(tmp_path: Path) -> None:
    """By whoever thought that we were gone."""
    listener = listen(UnixAddress(tmp_path / "s"))
    (tmp_path / "s").unlink()
    (tmp_path / "s").write_text("another's")

    listener.close()

    assert "another's" == (tmp_path / "s").read_text()


def test_two_servers_that_start_at_once(tmp_path: Path) -> None:
    """Over what a killed one left, again and again: one listens, and the other says why not."""
    for _ in range(30):
        killed = socket.socket(socket.AF_UNIX)
        killed.bind(str(tmp_path / "s"))
        killed.close()
        found: list[object] = []

        def start(found: list[object] = found) -> None:
            try:
                found.append(listen(UnixAddress(tmp_path / "s")))
            except AddressError as error:
                found.append(error)

        threads = [threading.Thread(target=start) for _ in range(2)]
        for each in threads:
            each.start()
        for each in threads:
            each.join()
        errors = [each for each in found if isinstance(each, AddressError)]
        assert 1 == len(errors)
        UnixAddress(tmp_path / "s").connect().close()
        for each in found:
            if not isinstance(each, AddressError):
                each.close()


@pytest.mark.parametrize(
    ("address", "problem"),
    [
        ("unix:/nowhere/at/all/s", "cannot be listened at: No such file"),
        (f"unix:/tmp/{'x' * 200}", "cannot be listened at: AF_UNIX path too long"),
        ("tcp:192.0.2.1:0", "expected 127.0.0.1, or --ask-any-host with a --token-file"),
        ("tcp:0.0.0.0:0", "expected 127.0.0.1, or --ask-any-host"),
        ("tcp:[::]:0", "expected 127.0.0.1, or --ask-any-host"),
        ("tcp:no.such.host.invalid:0", "cannot be listened at"),
    ],
)
def test_where_nobody_can_or_may_listen(address: str, problem: str) -> None:
    """The message says why, and what to do."""
    with pytest.raises(AddressError, match=problem):
        listen(read_address(address))


def test_other_hosts_may_ask_where_that_was_said() -> None:
    """On a port that is free; the address tells which."""
    listener = listen(read_address("tcp:0.0.0.0:0"), any_host=True)

    assert isinstance(listener.address, TcpAddress)
    assert listener.address.port
    listener.close()


def test_a_port_that_is_taken() -> None:
    first = listen(read_address("tcp:127.0.0.1:0"))
    with pytest.raises(AddressError, match="Address already in use"):
        listen(first.address)
    first.close()


def test_a_file_that_has_taken_its_place_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Closed twice: meanwhile another listens, and its file has the number that ours had."""
    monkeypatch.setattr(addresses, "_file_id", lambda _: (1, 1))
    first = listen(UnixAddress(tmp_path / "s"))
    first.close()
    second = listen(UnixAddress(tmp_path / "s"))

    first.close()

    assert (tmp_path / "s").exists()
    second.close()
    assert not (tmp_path / "s").exists()


def test_a_folder_that_stays_locked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Such as the log's own, which its writer locks: refused, not waited for without end."""
    monkeypatch.setattr(addresses, "LOCKED_S", 0.05)
    with (
        sl.create(tmp_path / "log", tz="UTC"),
        pytest.raises(AddressError, match=r"locked this folder.*another folder"),
    ):
        listen(UnixAddress(tmp_path / "log" / "s"))

    listen(UnixAddress(tmp_path / "log" / "s")).close()


@only_root
def test_a_folder_that_a_stranger_has_locked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who may only read it makes no socket there, so their lock keeps nobody out of it."""
    monkeypatch.setattr(addresses, "LOCKED_S", 0.0)
    tmp_path.chmod(0o755)

    def lock() -> int:
        fd = os.open(".", os.O_RDONLY)
        fcntl.flock(fd, fcntl.LOCK_EX)
        return fd

    with other_process(lock, tmp_path, uid=NOBODY):
        listen(UnixAddress(tmp_path / "s")).close()
        tmp_path.chmod(0o777)
        with pytest.raises(AddressError, match="locked this folder"):
            listen(UnixAddress(tmp_path / "s"))


@pytest.mark.parametrize("host", ["a" * 64, ".x", "x..y"])
def test_a_name_that_no_host_can_have(host: str) -> None:
    """Neither to ask nor to listen at."""
    address = TcpAddress(host, 1)

    with pytest.raises(AddressError, match="no server answers there: no host can have such a name"):
        address.connect()
    with pytest.raises(AddressError, match="listened at: no host can have such a name"):
        listen(address, any_host=True)
