"""Signing beside a writer: segments as they close, and a writer that never notices."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.signing import sign_beside
from semmap_log.signing.ed25519_sdk import SigningKey
from semmap_log.signing.log_signing import sign
from semmap_log.signing.sign_beside import SignBeside
from semmap_log.store.writing import segment_chain
from tests.live.running import wait_until
from tests.signing.signed_logs import checked, is_good, statements


@pytest.fixture
def office(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A log whose segments are closed often."""
    monkeypatch.setattr(segment_chain, "ROLL_COMMITS", 20)
    monkeypatch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 1)
    with sl.create(tmp_path / "office", tz="UTC") as log:
        log.add_door(name="front")
    return tmp_path / "office"


def observe(log: sl.DoorLogWriter, count: int) -> None:
    for number in range(count):
        log.observe("front", "open" if number % 2 else "closed")


def test_segments_are_signed_as_they_close_and_the_last_at_the_end(
    office: Path, key: SigningKey
) -> None:
    told: list[str] = []
    with SignBeside(office, key, tell=told.append, look_s=0.02) as beside, sl.append(office) as log:
        observe(log, 50)
        wait_until(lambda: len(statements(office)) >= 2, "two statements")
        observe(log, 5)

    assert beside.is_all_signed
    assert [] == told
    assert is_good(office, key)
    assert 57 == checked(office, key)[2].signed_before


def test_what_cannot_be_signed_is_told_once_and_recording_goes_on(
    office: Path, key: SigningKey
) -> None:
    """
    A file where the folder should be; once that is gone, all that was left is signed.
    """
    (office / "signatures").write_text("in the way")
    told: list[str] = []
    with SignBeside(office, key, tell=told.append, look_s=0.01) as beside, sl.append(office) as log:
        for _ in range(4):
            observe(log, 30)
            wait_until(lambda: beside.problem, "a problem")
        assert 1 == len(told)
        assert "not signed: " in told[0]
        assert "Recording goes on" in told[0]
    assert not beside.is_all_signed
    assert 1 == len(told)
    assert 122 == len(list(sl.read(office).history()))

    (office / "signatures").unlink()
    with SignBeside(office, key, tell=told.append, look_s=0.01) as beside, sl.append(office) as log:
        observe(log, 1)

    assert beside.is_all_signed
    assert is_good(office, key)


def test_it_is_told_when_it_works_again(office: Path, key: SigningKey) -> None:
    (office / "signatures").write_text("in the way")
    told: list[str] = []
    with SignBeside(office, key, tell=told.append, look_s=0.01) as beside, sl.append(office) as log:
        observe(log, 30)
        wait_until(lambda: beside.problem, "a problem")
        (office / "signatures").unlink()

    assert ["not signed", "signing works again."] == [told[0][:10], told[-1][-20:]]
    assert is_good(office, key)


def test_the_end_does_not_wait_for_ever(
    office: Path, key: SigningKey, monkeypatch: pytest.MonkeyPatch
) -> None:
    """
    What stands still is left behind; the next signing does it.
    """
    goes_on, begun = threading.Event(), threading.Event()

    def stuck(*_: object, **__: object) -> None:
        begun.set()
        goes_on.wait()
        raise OSError("late")

    with monkeypatch.context() as patch:
        patch.setattr(sign_beside, "sign", stuck)
        with SignBeside(office, key, look_s=0.01, end_s=0.05) as beside, sl.append(office) as log:
            observe(log, 3)
            assert begun.wait(100)
        assert not beside.is_all_signed
        goes_on.set()

    sign(office, key)
    assert is_good(office, key)
