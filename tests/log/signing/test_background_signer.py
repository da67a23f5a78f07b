"""Signing beside a writer: its end from time to time, and a writer that never notices."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.log.signing import background_signer
from semmap_log.log.signing.background_signer import BackgroundSigner
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import sign
from semmap_log.store.writing import segment_chain
from tests.live.ros.running import wait_until
from tests.log.signing.signed_logs import a_key, believed, checked, forget, is_good, statements


@pytest.fixture
def office(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log whose segments are closed often."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 20)
    monkeypatch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 1)
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.add_door(name="front")
    return tmp_path / "office"


@contextmanager
def recording(
    office: Path,
    key: SigningKey,
    *,
    every_s: float = 0.02,
    adopt: bool = False,
    tell: Callable[[str], None] = lambda _: None,
    durability: str = "event",
) -> Iterator[tuple[BackgroundSigner, sl.DoorLogWriter]]:
    """Hand out what signs a log, and its writer."""
    with (
        BackgroundSigner(office, key, tell=tell, every_s=every_s, adopt=adopt) as signer,
        sl.append(office, signer=signer, durability=durability) as log,
    ):
        yield signer, log


def observe(log: sl.DoorLogWriter, count: int) -> None:
    for number in range(count):
        log.observe("front", "open" if number % 2 else "closed")


@pytest.mark.parametrize("durability", ["event", "batch", "flush"])
def test_the_live_end_is_signed_from_time_to_time_and_at_the_end(
    office: Path, key: SigningKey, durability: str
) -> None:
    """A statement of the live end takes the place of the one before; some stay."""
    told: list[str] = []
    with recording(office, key, tell=told.append, durability=durability) as (signer, log):
        for done in range(2, 50, 4):
            observe(log, 4)
            wait_until(lambda done=done: signer.signed_before >= done + 4, "a signature")
        assert checked(office, key)[0] == 0  # the live end, too
        observe(log, 7)

    assert signer.is_all_signed
    assert [] == told
    assert is_good(office, key)
    code, _, found = checked(office, key)
    assert (0, 57) == (code, found.signed_before)
    assert 3 <= len(statements(office)) <= 6


def test_the_end_of_a_killed_recorder_is_signed_up_to_the_last_time(
    office: Path, key: SigningKey, tmp_path: Path
) -> None:
    """What it wrote since is an unsigned end, live."""
    with recording(office, key, every_s=3600) as (signer, log):
        wait_until(lambda: signer.signed_before == 2, "the first signature")
        observe(log, 3)
        killed = Path(shutil.copytree(office, tmp_path / "killed"))
        state = key.path.with_name("robot.state")  # type: ignore[union-attr]
        before = state.read_bytes()
    assert is_good(office, key)
    state.write_bytes(before)
    code, wrong, found = checked(killed, key)
    assert (6, ["unsigned"]) == (code, wrong)
    assert (2, 4) == found.found.findings[0].events

    told: list[str] = []
    with recording(killed, key, tell=told.append) as (signer, log):
        observe(log, 1)
        wait_until(lambda: signer.problem, "a problem")
    assert "events 2..4" in told[0]
    assert (6, ["unsigned"]) == checked(killed, key)[:2]

    with recording(killed, key, adopt=True) as (signer, log):
        observe(log, 1)
    assert signer.is_all_signed
    code, wrong, found = checked(killed, key)
    assert (6, ["adopted"]) == (code, wrong)
    assert (2, 5) == found.found.findings[0].events
    officer = a_key(tmp_path, "officer")
    sign(killed, officer)
    assert (0, []) == checked(killed, key, officer)[:2]


def test_what_was_written_without_the_key_is_not_signed_in_silence(
    office: Path, key: SigningKey
) -> None:
    """Not by a recorder: by who reads it, and signs."""
    sign(office, key)
    with sl.append(office) as log:
        observe(log, 1)
    with recording(office, key) as (signer, log):
        observe(log, 2)
        wait_until(lambda: signer.problem, "a problem")

    assert (6, ["unsigned"]) == checked(office, key)[:2]
    sign(office, key)
    with recording(office, key) as (signer, log):
        observe(log, 2)
    assert signer.is_all_signed
    assert is_good(office, key)


def test_what_lies_on_the_disk_is_not_signed_for_the_writer_s(
    office: Path, key: SigningKey, tmp_path: Path
) -> None:
    """Somebody puts more into the live file: what is signed is what the recorder wrote."""
    with suppress(sl.errors.LogPoisonedError), recording(office, key) as (signer, log):
        observe(log, 2)
        wait_until(lambda: signer.signed_before == 4, "a signature")
        other = Path(shutil.copytree(office, tmp_path / "other"))
        with sl.append(other) as opened:
            observe(opened, 1)
            for file in other.glob("*.mcap"):
                (office / file.name).write_bytes(file.read_bytes())
        looks: list[int] = []
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(signer, "_last_mark", lambda: looks.append(1))
            wait_until(lambda: len(looks) > 2, "more looks")

    assert 5 == sl.read(office).last_event() + 1
    code, _, found = checked(office, key)
    assert code in (4, 6)
    assert 4 == found.signed_before


def test_a_log_that_was_rolled_back_is_not_signed(
    office: Path, key: SigningKey, tmp_path: Path
) -> None:
    """With all of its older statements: the key's state knows better."""
    with recording(office, key) as (_, log):
        observe(log, 3)
    older = Path(shutil.copytree(office, tmp_path / "older"))
    with recording(office, key) as (_, log):
        observe(log, 3)
    shutil.rmtree(office)
    older.rename(office)
    assert is_good(office, key)

    told: list[str] = []
    with recording(office, key, tell=told.append) as (signer, log):
        observe(log, 5)
        wait_until(lambda: signer.problem, "a problem")

    assert "rolled back" in told[0] or "rewritten" in told[0]
    assert 6 == checked(office, key)[0]
    with pytest.raises(sl.errors.SigningError, match="rewritten, or is another branch"):
        sign(office, key)


def test_what_cannot_be_signed_is_told_once_and_recording_goes_on(
    office: Path, key: SigningKey
) -> None:
    """A file where the folder should be; once that is gone, all is signed."""
    (office / "signatures").write_text("in the way")
    told: list[str] = []
    with recording(office, key, tell=told.append) as (signer, log):
        for _ in range(4):
            observe(log, 30)
            wait_until(lambda: signer.problem, "a problem")
        assert 1 == len(told)
        assert "not signed: " in told[0]
        assert "Recording continues" in told[0]
        (office / "signatures").unlink()

    assert signer.is_all_signed
    assert ["not signed", "signing works again."] == [told[0][:10], told[-1][-20:]]
    assert 122 == len(list(sl.read(office).history()))
    assert is_good(office, key)


def test_the_end_does_not_wait_for_ever(
    office: Path, key: SigningKey, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What stands still is left behind; the next signing does it."""
    goes_on, begun = threading.Event(), threading.Event()

    def stuck(*_: object, **__: object) -> None:
        begun.set()
        goes_on.wait()
        raise OSError("late")

    with monkeypatch.context() as patch:
        patch.setattr(background_signer, "read_for_signing", stuck)
        with (
            BackgroundSigner(office, key, every_s=0.01, end_s=0.05) as signer,
            sl.append(office, signer=signer) as log,
        ):
            observe(log, 3)
            assert begun.wait(100)
        assert not signer.is_all_signed
        goes_on.set()

    sign(office, key)
    assert is_good(office, key)


def test_a_writer_that_is_opened_again_is_followed(office: Path, key: SigningKey) -> None:
    """As a server does when a write has failed."""
    with BackgroundSigner(office, key, every_s=0.02) as signer:
        for _ in range(3):
            with sl.append(office, signer=signer) as log:
                observe(log, 4)
                wait_until(lambda: signer.signed_before >= 6, "a signature")
    assert signer.is_all_signed
    assert 14 == signer.signed_before
    assert is_good(office, key)


def test_a_new_log_is_signed_from_its_first_event(tmp_path: Path, key: SigningKey) -> None:
    path = tmp_path / "new"
    with BackgroundSigner(path, key) as signer, sl.create(path, tz="UTC", signer=signer) as log:
        log.add_door(name="front")
    assert signer.is_all_signed
    assert is_good(path, key)
    forget(key, path)
    assert (4, ["unsigned"]) == checked(path, key)[:2]
    assert believed(key)
