"""Signing cut at each step, on a full disk, beside writers and compactions, and by two at once."""

from __future__ import annotations

import errno
import os
import resource
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import LogError, OutputError, SigningError
from semmap_log.log.replay.maintenance import verify
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import sign
from semmap_log.log.signing.signature_folder import BadSignature, read_all
from semmap_log.store.compaction import compact
from semmap_log.store.verification import verifying
from semmap_log.store.verification.file_place import DiskPlace
from semmap_log.store.verification.findings import arrange
from semmap_log.store.writing import segment_chain
from tests.log.signing.signed_logs import checked, forget, is_good, statements

CALLS = ("mkdir", "replace", "fsync", "open")
"""By which a signing changes what is on the disk."""


def cut_off(log: Path, key: SigningKey, call: str, at: int) -> bool:
    """Sign in a child that ends, without a word, before such a call; tell whether it did."""
    child = os.fork()
    if not child:
        left = count(1)
        really = getattr(os, call)

        def killed(*arguments, **named):  # type: ignore[no-untyped-def]
            if (call != "open" or arguments[1] & os.O_CREAT) and next(left) == at:
                os._exit(9)
            return really(*arguments, **named)

        setattr(os, call, killed)
        try:
            sign(log, key)
        finally:
            os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9


@pytest.mark.parametrize("call", CALLS)
def test_killed_at_each_step(log: Path, key: SigningKey, call: str) -> None:
    """What is there is whole; the next signing does the rest, and removes what was half."""
    kills = 0
    for at in count(1):
        if not cut_off(log, key, call, at):
            break
        kills += 1
        assert not [one for one in read_all(statements(log)) if isinstance(one, BadSignature)]
        assert set(checked(log, key)[1]) <= {"unsigned", "statement"}
        sign(log, key)
        _check_whole(log, key)
        forget(key, log)

    assert kills >= {"mkdir": 1, "replace": 9, "fsync": 18, "open": 9}[call]
    _check_whole(log, key)


@pytest.mark.parametrize("call", ["replace", "fsync", "open"])
def test_a_full_disk_at_each_step(
    log: Path, key: SigningKey, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    """It is said; what is there is whole, and nothing half lies about."""
    really = getattr(os, call)
    for at in count(1):
        left = count(1)

        def full(*arguments, left=left, at=at, **named):  # type: ignore[no-untyped-def]
            if (call != "open" or arguments[1] & os.O_CREAT) and next(left) == at:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return really(*arguments, **named)

        with monkeypatch.context() as patch:
            patch.setattr(os, call, full)
            try:
                sign(log, key)
            except OutputError as error:
                assert "No space left" in str(error)
            except SigningError as error:
                assert "No space left" in str(error)
                assert "Nothing is signed without it" in str(error)
            else:
                break
        assert set(checked(log, key)[1]) <= {"unsigned"}
        assert not [file for file in log.parent.rglob("*") if "tmp" in file.name]
        forget(key, log)
    assert at > 9
    _check_whole(log, key)


def test_a_disk_that_takes_no_more_than_some_bytes(log: Path, key: SigningKey) -> None:
    """A real limit of the system, by the command line."""
    key_file = log.parent / "robot"
    line = [sys.executable, "-m", "semmap_log", "sign", str(log), "--key", str(key_file)]

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))

    done = subprocess.run(line, capture_output=True, text=True, preexec_fn=limited, check=False)

    assert done.returncode == 1
    assert "robot.state" in done.stderr
    assert "could not be written" in done.stderr
    assert "Traceback" not in done.stderr
    assert [] == statements(log)
    subprocess.run(line, check=True, capture_output=True)
    _check_whole(log, key)


def test_beside_a_writer_and_a_compaction(
    tmp_path: Path, key: SigningKey, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Signed again and again while segments are closed, compacted and merged: it ends good."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 20)
    monkeypatch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 1)
    log = tmp_path / "log"
    with sl.create(log, tz="UTC") as opened:
        opened.add_door()
    ended = threading.Event()
    rounds = 0

    def sign_on() -> int:
        nonlocal rounds
        while not ended.is_set():
            sign(log, key)
            rounds += 1
        return rounds

    with ThreadPoolExecutor() as pool:
        signing = pool.submit(sign_on)
        try:
            for session in range(4):
                with sl.append(log) as opened:
                    for number in range(50):
                        opened.observe(1, "open" if number % 2 else "closed")
                compact(log, merge=bool(session % 2))
        finally:
            ended.set()
        assert signing.result() > 1

    sign(log, key)
    _check_whole(log, key)
    assert 201 == checked(log, key)[2].signed_before


def test_a_segment_that_is_continued_meanwhile_is_not_signed(
    tmp_path: Path, key: SigningKey, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Live, a power cut may still take its end."""
    log = tmp_path / "log"
    with sl.create(log, tz="UTC") as opened:
        opened.add_door()
    seen = arrange(DiskPlace(log))
    with sl.append(log) as opened, monkeypatch.context() as patch:
        opened.observe(1, "open")
        assert ([], True) == ((done := sign(log, key)).made, done.is_live)
        patch.setattr(verifying, "arrange", lambda _: seen)
        with pytest.raises(LogError, match="change faster than they can be read"):
            sign(log, key)
        assert [] == statements(log)

    sign(log, key)
    _check_whole(log, key)


def test_two_sign_at_once(log: Path, key: SigningKey) -> None:
    """They write the same bytes."""
    with ThreadPoolExecutor() as pool:
        for one in [pool.submit(sign, log, key) for _ in range(6)]:
            one.result()

    _check_whole(log, key)
    assert 3 == len(statements(log))


def _check_whole(log: Path, key: SigningKey) -> None:
    assert verify(log).exit_code == 0
    assert is_good(log, key)
    files = sorted(file.name for file in (log / "signatures").iterdir())
    assert not [name for name in files if "tmp" in name]
    assert len(files) == 2 * len(statements(log))
