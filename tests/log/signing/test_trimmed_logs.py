"""What signatures vouch for once something was taken out; and statements of version 1."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.core.model.moments import format_utc
from semmap_log.log.replay.maintenance import recover, verify
from semmap_log.log.signing.background_signer import BackgroundSigner
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import check_before_trimming, sign
from semmap_log.log.signing.signed_log import verify_signed
from semmap_log.log.signing.statement import (
    HEADS,
    TRIMMING,
    PublicKey,
    read_public_keys,
    signature_of,
)
from semmap_log.log.trimming.redaction import Notes, Redaction, Tracks
from semmap_log.log.trimming.trim_log import Retention, TrimRule, trim_log
from semmap_log.store.compaction import compact
from semmap_log.store.reading.reader import LogReader
from semmap_log.store.writing import segment_chain
from tests.log.signing.signed_logs import a_key, checked, is_good, statements
from tests.log.trimming.logs import MinuteClock, random_log


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with poses, notes and sightings in some segments."""
    with pytest.MonkeyPatch.context() as patch:
        return random_log(tmp_path_factory.mktemp("walked"), 1, patch, commits=90, roll=25)


@pytest.fixture
def office(walked: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(walked, tmp_path / "log"))


@pytest.fixture
def officer(tmp_path: Path) -> SigningKey:
    return a_key(tmp_path, "officer")


def believed(robot: SigningKey, officer: SigningKey) -> dict[bytes, PublicKey]:
    """Return the robot for what was recorded, the officer for what was taken out."""
    return {
        robot.public_bytes: PublicKey(robot.public_bytes, "robot", frozenset({HEADS})),
        officer.public_bytes: PublicKey(officer.public_bytes, "officer", frozenset({TRIMMING})),
    }


def wrong(log: Path, robot: SigningKey, officer: SigningKey) -> tuple[int, set[str]]:
    """Return the exit code, and the kinds of what is not as signed."""
    found = verify_signed(log, believed(robot, officer)).found
    return found.exit_code, {one.kind for one in found.findings if one.severity}


def rules(log: Path) -> Sequence[TrimRule]:
    """Return something to redact, and something to expire."""
    reader = LogReader(log)
    return (
        Redaction.of(reader, [Tracks(), Notes("anna")], reader.last_event() + 1),
        Retention(reader, reader.last_log_time_ns() - 50 * 120 * 10**9),
    )


def trim(log: Path, which: int) -> None:
    assert trim_log(log, rules(log)[which], writing={"clock": MinuteClock()}).event is not None


@pytest.mark.parametrize("which", [0, 1], ids=["redacted", "expired"])
def test_what_an_officer_has_taken_out_is_vouched_for(
    office: Path, key: SigningKey, officer: SigningKey, which: int
) -> None:
    """Through copies, compaction, merges and more trimming; and the robot goes on."""
    sign(office, key)
    check_before_trimming(office, officer)
    trim(office, which)
    sign(office, officer, trimmed=True)
    assert (0, set()) == wrong(office, key, officer)
    sign(office, key)
    with BackgroundSigner(office, key) as signer, sl.append(office, signer=signer) as log:
        log.observe(1, "open")
    assert signer.is_all_signed
    compact(office, merge=True, keep_s=0)
    assert (0, set()) == wrong(office, key, officer)

    check_before_trimming(office, officer)
    trim(office, 1 - which)
    assert (4, {"taken-out", "unsigned"}) == wrong(office, key, officer)
    sign(office, officer, trimmed=True)
    sign(office, key)
    assert (0, set()) == wrong(office, key, officer)
    copy = Path(shutil.copytree(office, office.with_name("copy")))
    assert (0, set()) == wrong(copy, key, officer)


def test_a_head_before_all_that_was_taken_out_is_still_enough(office: Path) -> None:
    """And one after it is not: it does not bind what is left there."""
    first = list(sl.read(office).commits())[-1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 1)
        for _ in range(2):
            with sl.append(office, clock=MinuteClock()) as log:
                log.observe(1, "open", actor="late")
    late = list(sl.read(office).commits())[-1]
    rule = Redaction.of(LogReader(office), [Notes("late")], late.last_event + 1)
    assert trim_log(office, rule, writing={"clock": MinuteClock()}).event is not None

    assert (0, 4) == (verify(office, first.hash).exit_code, verify(office, late.hash).exit_code)


def test_an_officer_vouches_for_no_more_than_came_before(
    office: Path, key: SigningKey, officer: SigningKey
) -> None:
    """What was taken out of later files is nobody's word."""
    trim(office, 0)
    sign(office, officer, trimmed=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 1)
        for _ in range(2):
            with sl.append(office, clock=MinuteClock()) as log:
                log.observe(1, "open", actor="late")
    last = LogReader(office).last_event()
    rule = Redaction.of(LogReader(office), [Notes("late")], last + 1)
    assert trim_log(office, rule, writing={"clock": MinuteClock()}).event is not None
    sign(office, key)

    assert (4, {"taken-out"}) == wrong(office, key, officer)


def test_a_state_that_is_lost_is_not_guessed(office: Path, key: SigningKey, tmp_path: Path) -> None:
    """Statements of the key are there, and it does not know them: the log may be an older one."""
    sign(office, key)
    state = tmp_path / "robot.state"
    before = state.read_bytes()
    state.unlink()
    with pytest.raises(sl.errors.SigningError, match=r"known.*--adopt"):
        sign(office, key)
    done = sign(office, key, adopt=True)
    assert ([], None) == (done.made, done.adopted)
    assert before == state.read_bytes()

    state.write_bytes(before[:-9] + b'0"}\n')
    with pytest.raises(sl.errors.SigningError, match=r"robot.state"):
        sign(office, key)
    state.unlink()
    with sl.append(office) as log:
        log.observe(1, "open")
    done = sign(office, key, adopt=True)
    assert (1, 1) == (len(done.made), done.adopted[1] - done.adopted[0] + 1)  # type: ignore[index]
    assert (6, ["adopted"]) == checked(office, key)[:2]


def old_statement(log: Path, key: SigningKey, first: int, end: int) -> None:
    """Sign commits as version 1 did, written by hand from docs/log_format.md."""
    commits = list(sl.read(log).commits())
    inside = [one for one in commits if first <= one.first_event < end]
    text = (
        f"semmap-log head 1\nlog: {sl.read(log).info.log_id}\nfirst-event: {first}\n"
        f"next-event: {end}\ncommits: {len(inside)}\n"
        f"recorded: {format_utc(inside[-1].recorded_ns)}\n"
        f"previous-head: {inside[0].previous_hash.hex()}\nhead: {inside[-1].hash.hex()}\n"
    )
    whose = hashlib.sha256(key.public_bytes).hexdigest()[:16]
    path = log / "signatures" / f"{end - 1:012d}_{whose}.head"
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)
    path.with_name(f"{path.name}.sig").write_text(signature_of(text.encode(), key))


def test_statements_of_version_1_are_read(
    office: Path, key: SigningKey, officer: SigningKey
) -> None:
    """They stand for what is whole; signing goes on after them."""
    ends = [one.last_event + 1 for one in sl.read(office).commits()]
    old_statement(office, key, 0, ends[30])
    assert (6, ["unsigned"]) == checked(office, key)[:2]
    old_statement(office, key, ends[30], ends[-1])
    assert is_good(office, key)
    assert [] == sign(office, key).made

    with sl.append(office) as log:
        log.observe(1, "open")
    assert 1 == len(sign(office, key).made)
    assert is_good(office, key)
    trim(office, 0)
    assert 4 == wrong(office, key, officer)[0]
    sign(office, officer, adopt=True)
    assert 0 == wrong(office, key, officer)[0]
    statements(office)[0].unlink()
    assert 0 == wrong(office, key, officer)[0]


def test_statements_of_version_1_do_not_vouch_for_what_is_trimmed(
    office: Path, key: SigningKey, officer: SigningKey
) -> None:
    ends = [one.last_event + 1 for one in sl.read(office).commits()]
    trim(office, 1)
    old_statement(office, key, ends[-1], LogReader(office).last_event() + 1)

    code, kinds = wrong(office, key, officer)
    assert (4, {"taken-out"}) == (code, kinds)
    sign(office, officer, adopt=True)
    assert (0, set()) == wrong(office, key, officer)


def test_a_recovered_log_is_signed_on(office: Path, key: SigningKey) -> None:
    """What `recover` adds is an unsigned end."""
    sign(office, key)
    for mark in office.glob("closed-*.json"):
        mark.write_text("{}")
    recover(office)
    assert (6, ["unsigned"]) == checked(office, key)[:2]
    sign(office, key)
    assert is_good(office, key)


def test_a_successor_goes_on_in_a_key_s_place(
    office: Path, key: SigningKey, officer: SigningKey, tmp_path: Path
) -> None:
    """Who believes the old key believes it, too; the old one signs no more."""
    sign(office, key)
    (named,) = read_public_keys([tmp_path / "officer.pub"]).values()
    assert 1 == len(sign(office, key, next_key=named).made)
    state = (tmp_path / "robot.state").read_bytes()
    with sl.append(office) as log:
        log.observe(1, "open")
    with pytest.raises(sl.errors.SigningError, match="this key's successor signs it now"):
        sign(office, key)
    sign(office, officer)
    assert is_good(office, key)
    assert {"key 0", "the successor of key 0"} == {one.owner for one in checked(office, key)[2].by}
    assert 4 == checked(office, officer)[0]  # what came before is another's word

    (tmp_path / "robot.state").unlink()
    stolen = {file: file.read_bytes() for file in (office / "signatures").iterdir()}
    for file in stolen:
        if b"next-key: ssh" in file.read_bytes():
            file.unlink()
    sign(office, key, adopt=True)
    for file, data in stolen.items():
        file.write_bytes(data)
    code, kinds, _ = checked(office, key)
    assert 4 == code
    assert set(kinds) & {"signer", "fork"}
    (tmp_path / "robot.state").write_bytes(state)
