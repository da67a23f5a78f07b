"""Time stamps of statements: an authority made by openssl gives them, and openssl checks them."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

import semmap_log as sl
from semmap_log.errors import SigningError
from semmap_log.log.signing import signature_folder
from semmap_log.log.signing.background_signer import BackgroundSigner
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.signature_folder import signed_in, stamp_newest, token_file
from semmap_log.log.signing.timestamp_token import MOST_BYTES, query, stamped_time
from semmap_log.views.health import signed_verification_report
from tests.log.signing.authority import Authority, needs_openssl, openssl, served
from tests.log.signing.signed_logs import checked, is_good, sign, statements

pytestmark = needs_openssl
DIGEST = hashlib.sha256(b"a text").digest()


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("tsa") / "tsa")


@pytest.fixture(scope="module")
def answer(authority: Authority) -> bytes:
    """An answer about `a text`."""
    return authority.answer(query(DIGEST)[0])


def test_the_newest_statement_gets_a_time_stamp(
    log: Path, key: SigningKey, authority: Authority
) -> None:
    """openssl alone checks it, and notices an altered statement; verify says which one has it."""
    sign(log, key)
    newest = statements(log)[-1]

    with served(authority.answer) as (url, asked):
        stamped = stamp_newest(log, key, url)
        assert stamped == stamp_newest(log, key, url)

    assert stamped is not None
    assert 1 == len(asked)
    assert newest == stamped.path
    assert "OK" == authority.verifies(newest, token_file(newest))
    assert "message imprint mismatch" in authority.verifies(statements(log)[0], token_file(newest))
    said = openssl("ts", "-reply", "-in", token_file(newest), "-text", folder=log).stdout
    code, _, done = checked(log, key)
    assert 0 == code
    assert {**dict.fromkeys(statements(log)), newest: stamped.time} == dict(done.times)
    _, day, clock, year, _ = said.partition("Time stamp: ")[2].partition("\n")[0].split()
    assert stamped.time.startswith(year)
    assert clock.split(".")[0] in stamped.time
    assert f"-{int(day):02d}T" in stamped.time


def test_the_query_is_that_of_openssl(tmp_path: Path) -> None:
    """All but its random number, byte for byte."""
    (tmp_path / "text").write_bytes(b"a text")
    done = openssl("ts", "-query", "-data", "text", "-sha256", "-cert", "-out", "theirs",
                   folder=tmp_path)  # fmt: skip
    assert done.returncode == 0

    ours, nonce = query(DIGEST)

    theirs = (tmp_path / "theirs").read_bytes()
    assert 69 == len(ours)
    assert theirs[2:56] == ours[2:56]
    assert ours[58:66] == nonce
    assert theirs[-3:] == ours[-3:]
    (tmp_path / "ours").write_bytes(ours)
    said = openssl("ts", "-query", "-in", "ours", "-text", folder=tmp_path).stdout
    assert f"Nonce: 0x{nonce.hex().upper()}" in said
    assert "Certificate required: yes" in said


def test_a_time_stamp_of_something_else_shows(
    log: Path, key: SigningKey, authority: Authority
) -> None:
    """Of another statement, or altered: code 4."""
    sign(log, key)
    with served(authority.answer) as (url, _):
        stamp_newest(log, key, url)
    first, _, last = statements(log)
    token = token_file(last)

    token.rename(token_file(first))

    code, wrong, done = checked(log, key)
    assert (4, ["timestamp"]) == (code, wrong)
    assert "of another text" in done.found.findings[0].text
    token_file(first).write_bytes(b"")
    assert (4, ["timestamp"]) == checked(log, key)[:2]
    token_file(first).unlink()
    token_file(first).mkdir()
    assert (4, ["timestamp"]) == checked(log, key)[:2]


def test_a_statement_at_a_live_end_keeps_its_time_stamp(
    log: Path, key: SigningKey, authority: Authority
) -> None:
    """Others that a recorder has made between give way to the next."""
    sign(log, key)
    with BackgroundSigner(log, key, every_s=60) as signer, sl.append(log, signer=signer) as opened:
        signer._marks = signer._last_mark()
        opened.observe("front", "open")
        signer._look(is_last=False)
        with served(authority.answer) as (url, _):
            stamped = stamp_newest(log, key, url)
        opened.observe("front", "closed")
        signer._look(is_last=False)
        middle = set(statements(log))
        opened.observe("front", "open")

    assert stamped is not None
    assert "OK" == authority.verifies(stamped.path, token_file(stamped.path))
    assert stamped.path in statements(log)
    assert middle - set(statements(log))
    assert is_good(log, key)


@pytest.mark.parametrize(
    ("said", "problem"),
    [
        (b"", "expected one element of DER, got 0"),
        (b"<html>", "DER"),
        (bytes.fromhex("30053003020102"), "the authority refuses it: status 02"),
        (bytes.fromhex("300d300b020102300 60c046e6f7065".replace(" ", "")), "status 02, nope"),
        (b"0" * (MOST_BYTES + 1), "expected at most 65,536 bytes, got more"),
        (bytes.fromhex("30053003020100"), "expected more than 1 elements"),
    ],
    ids=["nothing", "a page", "refused", "refused in words", "without end", "no token"],
)
def test_an_answer_that_is_no_time_stamp(
    said: bytes, problem: str, log: Path, key: SigningKey
) -> None:
    """Nothing is kept of it; what was signed stays signed."""
    sign(log, key)

    with (
        served(lambda _: said) as (url, _),
        pytest.raises(SigningError, match=f"no time stamp: .*{problem}"),
    ):
        stamp_newest(log, key, url)

    assert is_good(log, key)
    assert not list((log / "signatures").glob("*.tsr"))


def test_an_answer_to_another_query(log: Path, key: SigningKey, authority: Authority) -> None:
    """An old answer about the same statement is refused: by its random number."""
    sign(log, key)
    digest = bytes.fromhex(signed_in(log)[-1].digest)
    old = authority.answer(query(digest)[0])
    assert stamped_time(old, digest)

    with (
        served(lambda _: old) as (url, _),
        pytest.raises(SigningError, match="the answer to another query"),
    ):
        stamp_newest(log, key, url)


def test_an_authority_that_does_not_answer(
    log: Path, key: SigningKey, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not there, not well, or too slow."""
    sign(log, key)
    with (
        served(lambda _: b"", status=503) as (url, _),
        pytest.raises(SigningError, match="the answer is 503"),
    ):
        stamp_newest(log, key, url)
    with pytest.raises(SigningError, match="cannot be reached"):
        stamp_newest(log, key, url)
    with pytest.raises(SigningError, match="no time stamp"):
        stamp_newest(log, key, "http://a b/")
    with pytest.raises(SigningError, match="expected http"):
        stamp_newest(log, key, Path("/etc/hostname").as_uri())
    monkeypatch.setattr(signature_folder, "WITHIN_S", 0.3)
    with (
        served(lambda _: bytes(100), drip_s=0.1) as (url, _),
        pytest.raises(SigningError, match="the answer has no end within"),
    ):
        stamp_newest(log, key, url)


def test_every_cut_answer_is_refused(answer: bytes) -> None:
    """And what reads it meets nothing else than its error."""
    assert stamped_time(answer, DIGEST)
    for end in range(len(answer)):
        with pytest.raises(ValueError, match="DER"):
            stamped_time(answer[:end], DIGEST)


@given(st.binary(max_size=80))
def test_bytes_of_strangers_are_no_time_stamp(data: bytes) -> None:
    """Whatever they are."""
    with pytest.raises(ValueError):  # noqa: PT011 - whichever
        stamped_time(data, DIGEST)


def test_an_answer_with_any_byte_altered(answer: bytes) -> None:
    """It is refused, or altered in what openssl alone checks."""
    refused = 0
    for place in range(len(answer)):
        altered = bytearray(answer)
        altered[place] ^= 0x21
        try:
            stamped_time(bytes(altered), DIGEST)
        except ValueError:
            refused += 1
    assert len(DIGEST) < refused < len(answer)


def test_a_report_says_of_each_statement_whether_it_has_one(
    log: Path, key: SigningKey, authority: Authority
) -> None:
    """In 80 columns; of a log without any nothing is said."""
    sign(log, key)
    assert "time stamp" not in str([str(line) for line in _lines(log, key)])
    with served(authority.answer) as (url, _):
        stamp_newest(log, key, url)

    lines = _lines(log, key)

    assert 2 == sum(line.endswith("  no time stamp") for line in lines)
    assert "1 time stamp; openssl ts -verify checks whose" in lines
    assert all(len(line) <= 80 for line in lines if "time stamp" in line)


def _lines(log: Path, key: SigningKey) -> list[str]:
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(signed_verification_report(checked(log, key)[2]))
    return [line.rstrip() for line in console.export_text().splitlines()]
