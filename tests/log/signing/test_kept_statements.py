"""Statements, their signatures and time stamps outlast what is done to a log, as the guide says."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.events import RobotPose
from semmap_log.log.replay.maintenance import copy
from semmap_log.log.signing.background_signer import BackgroundSigner
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import check_before_trimming, sign
from semmap_log.log.signing.signature_folder import stamp_newest, token_file
from semmap_log.log.signing.signed_log import verify_signed
from semmap_log.log.signing.statement import HEADS, TRIMMING, PublicKey
from semmap_log.log.trimming.redaction import Notes, Redaction, Tracks
from semmap_log.log.trimming.trim_log import Retention, TrimRule, trim_log
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.log.signing.authority import Authority, needs_openssl, served
from tests.log.signing.signed_logs import a_key, checked, statements
from tests.log.trimming.logs import MinuteClock

pytestmark = needs_openssl
SESSIONS = 3


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("tsa") / "tsa")


@pytest.fixture
def robot(tmp_path: Path) -> SigningKey:
    return a_key(tmp_path)


@pytest.fixture
def officer(tmp_path: Path) -> SigningKey:
    return a_key(tmp_path, "officer")


@pytest.fixture
def office(
    tmp_path: Path, robot: SigningKey, authority: Authority, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """A log of several segments, whose statement about the first has a time stamp."""
    monkeypatch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 1)
    log, clock = tmp_path / "log", MinuteClock()
    for session in range(SESSIONS):
        with (
            sl.append(log, clock=clock) if session else sl.create(log, tz="UTC", clock=clock)
        ) as opened:
            if not session:
                opened.add_door(name="front", x=0.0, y=0.0, theta=0.0, width=0.9)
            for i in range(4):
                opened.append([RobotPose(x=float(i), y=0.0, theta=0.0)])
                opened.observe("front", "open" if i % 2 else "closed", actor="anna")
        sign(log, robot)
        if not session:
            _stamp(log, robot, authority)
    return log


def _stamp(log: Path, key: SigningKey, authority: Authority) -> Path:
    """Get a time stamp for the newest statement; return its file."""
    with served(authority.answer) as (url, _):
        stamped = stamp_newest(log, key, url)
    assert stamped is not None
    return stamped.path


def _redaction(reader: LogReader) -> TrimRule:
    return Redaction.of(reader, [Tracks(), Notes("anna")], reader.last_event() + 1)


def _retention(reader: LogReader) -> TrimRule:
    """Everything of the first segments goes, and what was signed there with it."""
    return Retention(reader, reader.last_log_time_ns())


def _trim(log: Path, officer: SigningKey, rule: Callable[[LogReader], TrimRule]) -> None:
    check_before_trimming(log, officer)
    done = trim_log(log, rule(LogReader(log)), writing={"clock": MinuteClock()})
    assert done.event is not None
    sign(log, officer, trimmed=True)


def _files(log: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in (log / "signatures").iterdir()}


def _believed(robot: SigningKey, officer: SigningKey) -> dict[bytes, PublicKey]:
    return {
        robot.public_bytes: PublicKey(robot.public_bytes, "robot", frozenset({HEADS})),
        officer.public_bytes: PublicKey(officer.public_bytes, "officer", frozenset({TRIMMING})),
    }


def _merge(log: Path, _officer: SigningKey) -> None:
    segments = len(list(log.glob("*.mcap")))
    compact(log, merge=True, keep_s=0)
    assert len(list(log.glob("*.mcap"))) < segments


STEPS: dict[str, Callable[[Path, SigningKey], None]] = {
    "redact": lambda log, officer: _trim(log, officer, _redaction),
    "retain": lambda log, officer: _trim(log, officer, _retention),
    "compact": _merge,
}


@pytest.mark.parametrize(
    "steps",
    [["redact"], ["retain"], ["compact"], ["redact", "compact", "retain"]],
    ids=", ".join,
)
def test_every_statement_stays(
    steps: list[str], office: Path, robot: SigningKey, officer: SigningKey, authority: Authority
) -> None:
    """
    With its signature and its time stamp, byte for byte, also where what it was about is gone.
    """
    for step in steps:
        before = _files(office)
        times = verify_signed(office, _believed(robot, officer)).times

        STEPS[step](office, officer)

        assert before.items() <= _files(office).items()
        sign(office, robot)
        done = verify_signed(office, _believed(robot, officer))
        assert 0 == done.found.exit_code
        assert dict(times).items() <= dict(done.times).items()
    (stamped,) = [path for path, time in done.times if time is not None]
    assert "OK" == authority.verifies(stamped, token_file(stamped))


def test_an_officers_statement_keeps_its_time_stamp(
    office: Path, robot: SigningKey, officer: SigningKey, authority: Authority
) -> None:
    """
    When more is taken out.
    """
    _trim(office, officer, _redaction)
    stamped = _stamp(office, officer, authority)
    before = _files(office)
    assert stamped.suffix == ".trim"

    _trim(office, officer, _retention)

    assert before.items() <= _files(office).items()
    sign(office, robot)
    done = verify_signed(office, _believed(robot, officer))
    assert 0 == done.found.exit_code
    assert 2 == sum(time is not None for _, time in done.times)
    assert "OK" == authority.verifies(stamped, token_file(stamped))


def test_a_copy_is_checked_with_the_statements_of_the_log(
    office: Path, robot: SigningKey, tmp_path: Path
) -> None:
    """
    It has none of its own, which copying says; those of the log are as they were.
    """
    before, times = _files(office), checked(office, robot)[2].times

    done = copy(office, tmp_path / "copy")

    assert ("signatures",) == done.left_out
    assert not (tmp_path / "copy" / "signatures").exists()
    assert before == _files(office)
    code, wrong, found = checked(done.path, robot, elsewhere=[office / "signatures"])
    assert (0, []) == (code, wrong)
    assert times == found.times
    assert (4, ["unsigned"]) == checked(done.path, robot)[:2]


def test_a_statement_at_a_live_end_that_has_a_time_stamp_is_missed(
    office: Path, robot: SigningKey, authority: Authority
) -> None:
    """
    It is kept, so the next one names it; without a time stamp it gives way.
    """
    with BackgroundSigner(office, robot) as signer, sl.append(office, signer=signer) as log:
        signer._marks = signer._last_mark()
        log.observe("front", "open")
        signer._look(is_last=False)
        stamped = _stamp(office, robot, authority)
        for state in ("closed", "open"):
            log.observe("front", state)
            signer._look(is_last=False)
        log.observe("front", "closed")
    assert (0, []) == checked(office, robot)[:2]

    for file in office.glob(f"signatures/{stamped.name}*"):
        file.unlink()

    assert (4, ["statement"]) == checked(office, robot)[:2]
    assert stamped not in statements(office)
