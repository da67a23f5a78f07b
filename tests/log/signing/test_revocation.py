"""Keys revoked by an owner: their statements from a number on do not count, those before do."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.errors import SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import revoke, sign
from semmap_log.log.signing.signature_folder import (
    Revocation,
    SignedStatement,
    name_of,
    read_signed,
    signed_in,
    write_signed,
)
from semmap_log.log.signing.signed_log import verify_signed
from semmap_log.log.signing.statement import (
    HEADS,
    NO_DIGEST,
    REVOKING,
    PublicKey,
    Statement,
    signature_of,
)
from semmap_log.store.verification import Severity
from tests.log.signing.signed_logs import a_key, needs_ssh_keygen, statements
from tests.store.eventful import eventful_log, flip


@pytest.fixture
def owner(tmp_path: Path) -> SigningKey:
    return a_key(tmp_path, "owner")


def public(key: SigningKey, *namespaces: str) -> PublicKey:
    return PublicKey(key.public_bytes, namespaces=frozenset(namespaces or {HEADS}))


def checked(
    log: Path, owner: SigningKey, *keys: SigningKey, elsewhere: tuple[Path, ...] = ()
) -> tuple[int, list[str], int]:
    """Verify a log; return the exit code, the kinds of what is wrong, and where it is signed to."""
    keyring = {key.public_bytes: public(key) for key in keys}
    keyring[owner.public_bytes] = public(owner, REVOKING)
    done = verify_signed(log, keyring, elsewhere=elsewhere)
    wrong = done.found.of(Severity.NOT_AS_SIGNED, Severity.UNSIGNED)
    return done.found.exit_code, sorted(one.kind for one in wrong), done.signed_before


def last_signed(log: Path, number: int) -> Statement:
    """Return the statement of a number."""
    (found,) = (
        one.statement for one in signed_in(log)
        if isinstance(one.statement, Statement) and one.statement.number == number
    )  # fmt: skip
    return found


def put(log: Path, said: Statement, key: SigningKey) -> Path:
    """Write a statement as a thief of the key does: whatever the key's state knows."""
    return write_signed(log, name_of(said, key, HEADS), said.text, key, HEADS)


def forget_state(key: SigningKey) -> None:
    """Let a key know nothing of what it has signed."""
    assert key.path is not None
    key.path.with_name(key.path.name + ".state").unlink()


def test_what_was_signed_before_stands(log: Path, key: SigningKey, owner: SigningKey) -> None:
    """From the number on it is code 4; once that is moved away, another key goes on."""
    sign(log, key)
    end = last_signed(log, 1).next_event
    assert (0, [], 13) == checked(log, owner, key)

    revoke(log, owner, public(key), first=2)

    assert (4, ["revoked", "unsigned"], end) == checked(log, owner, key)
    statements(log)[-1].unlink()
    assert (6, ["unsigned"], end) == checked(log, owner, key)
    other = a_key(log.parent, "other")
    sign(log, other)
    assert (0, [], 13) == checked(log, owner, key, other)


def test_what_is_signed_later_shows(log: Path, key: SigningKey, owner: SigningKey) -> None:
    """A revocation for what comes next leaves the log good; the key signs no more of it."""
    sign(log, key)
    revoke(log, owner, public(key), first=3)
    assert (0, [], 13) == checked(log, owner, key)

    with sl.append(log) as opened:
        opened.observe("front", "open")
    sign(log, key)

    assert (4, ["revoked", "unsigned"], 13) == checked(log, owner, key)


def test_all_can_be_revoked(log: Path, key: SigningKey, owner: SigningKey) -> None:
    """From number 0 on nothing counts; the lowest of several revocations does."""
    sign(log, key)
    revoke(log, owner, public(key), first=2)
    revoke(log, owner, public(key), first=0)

    assert (4, ["revoked"] * 3 + ["unsigned"], 0) == checked(log, owner, key)


def test_the_number_counts_whatever_statement_is_named_last(
    log: Path, key: SigningKey, owner: SigningKey
) -> None:
    """A revocation from 1 on that names statement 2 as the last to count revokes 1 and 2."""
    sign(log, key)
    revoke(log, owner, public(key), first=2)
    (file,) = (log / "signatures").glob("*.revoke")
    (newest,) = (one for one in signed_in(log) if one.statement == last_signed(log, 2))
    said = Revocation(newest.statement.log_id, public(key).words, 1, newest.digest)
    file.unlink()
    write_signed(log, file.name, said.text, owner, REVOKING)

    assert (4, ["revoked"] * 2 + ["unsigned"], last_signed(log, 0).next_event) == checked(
        log, owner, key
    )


def test_a_number_from_before_reaches_no_further(
    log: Path, key: SigningKey, owner: SigningKey
) -> None:
    """A thief can write any number that did not stay, but not sign more of the log with it."""
    sign(log, key)
    newest, kept = last_signed(log, 2), last_signed(log, 1)
    revoke(log, owner, public(key), first=5)
    sign_of_two = statements(log)[-1]
    file = next((log / "signatures").glob("*.revoke"))
    said = Revocation(kept.log_id, public(key).words, 5, signed_in(log)[1].digest)
    file.unlink()
    write_signed(log, file.name, said.text, owner, REVOKING)
    sign_of_two.unlink()
    assert (6, ["unsigned"], kept.next_event) == checked(log, owner, key)

    put(log, replace(newest, number=0, before=NO_DIGEST), key)

    code, wrong, end = checked(log, owner, key)
    assert (4, kept.next_event) == (code, end)
    assert "revoked" in wrong
    max(statements(log)).unlink()
    assert (6, ["unsigned"], kept.next_event) == checked(log, owner, key)
    put(log, replace(kept, number=3, taken=NO_DIGEST, before=NO_DIGEST), key)
    assert (4, ["revoked", "unsigned"], kept.next_event) == checked(log, owner, key)


def test_a_thief_signs_no_other_log_in_its_place(
    log: Path, key: SigningKey, owner: SigningKey, tmp_path: Path
) -> None:
    """The same numbers and the revocation beside them: the last one that counts is missing."""
    other = eventful_log(tmp_path / "other", accuracy=0.8)
    sign(log, key)
    revoke(log, owner, public(key), first=2)
    forget_state(key)
    sign(other, key)
    for file in (log / "signatures").glob("*.revoke*"):
        shutil.copy(file, other / "signatures")

    assert (4, ["revoked"] * 3 + ["statement", "unsigned"], 0) == checked(other, owner, key)


def test_a_thief_names_no_successor(log: Path, key: SigningKey, owner: SigningKey) -> None:
    """Of a revoked statement nothing counts; one that was named before goes on."""
    sign(log, key)
    thief = a_key(log.parent, "thief")
    sign(log, key, next_key=public(thief))
    sign(log, thief)
    assert (0, [], 13) == checked(log, owner, key)

    (naming,) = (one for one in signed_in(log) if "next-key: ssh" in one.path.read_text())
    assert isinstance(naming.statement, Statement)
    number = naming.statement.number
    made = revoke(log, owner, public(key), first=number)
    code, wrong, _ = checked(log, owner, key)
    assert (4, {"revoked", "signer"}) == (code, set(wrong) - {"unsigned"})

    for file in (made, made.with_name(made.name + ".sig")):
        file.unlink()
    revoke(log, owner, public(key), first=number + 1)
    assert (0, [], 13) == checked(log, owner, key)


def test_only_an_owner_revokes(log: Path, key: SigningKey, owner: SigningKey) -> None:
    """Neither the robot's key, nor a stranger's; nor an owner's signature for another purpose."""
    sign(log, key)
    with pytest.raises(SigningError, match="expected an owner's key"):
        revoke(log, key, public(key), first=2)
    stranger = a_key(log.parent, "stranger")
    made = revoke(log, stranger, public(key), first=2)
    assert (4, ["signer"], 13) == checked(log, owner, key)
    assert (4, ["signer"], 13) == checked(log, owner, key, stranger)  # for statements only

    signature = made.with_name(made.name + ".sig")
    signature.write_text(signature_of(made.read_bytes(), owner, HEADS))
    assert (4, ["signature"], 13) == checked(log, owner, key)
    signature.write_text(signature_of(made.read_bytes(), owner, REVOKING))
    assert (4, ["revoked", "unsigned"]) == checked(log, owner, key)[:2]


def test_an_owner_signs_no_statement(log: Path, key: SigningKey, owner: SigningKey) -> None:
    """In the namespace of revocations nothing else counts."""
    sign(log, owner)
    for file in statements(log):
        text = signature_of(file.read_bytes(), owner, REVOKING)
        file.with_name(file.name + ".sig").write_text(text)

    assert (4, ["signature"] * 3 + ["unsigned"], 0) == checked(log, owner, key)


def test_an_altered_revocation_shows(log: Path, key: SigningKey, owner: SigningKey) -> None:
    """Wherever a byte of it is another."""
    sign(log, key)
    made = revoke(log, owner, public(key), first=2)
    good = made.read_bytes()
    for place in range(0, len(good), 7):
        flip(made, place)
        assert not isinstance(read_signed(made), SignedStatement)
        assert checked(log, owner, key)[1][0] in {"signature", "statement"}
        made.write_bytes(good)


def test_a_revocation_of_another_log_shows(
    log: Path, key: SigningKey, owner: SigningKey, tmp_path: Path
) -> None:
    """It revokes nothing here."""
    sign(log, key)
    other = tmp_path / "other"
    with sl.create(other) as opened:
        opened.add_door(x=0, y=0, theta=0, width=0.9)
    sign(other, key)
    made = revoke(other, owner, public(key), first=0)

    assert (4, ["statement"], 13) == checked(log, owner, key, elsewhere=(made,))


def test_a_revocation_can_be_kept_elsewhere(
    log: Path, key: SigningKey, owner: SigningKey, tmp_path: Path
) -> None:
    """Who can write to the log can remove it there."""
    sign(log, key)
    made = revoke(log, owner, public(key), first=2)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for file in (made, made.with_name(made.name + ".sig")):
        file.rename(elsewhere / file.name)
    assert (0, [], 13) == checked(log, owner, key)

    assert 4 == checked(log, owner, key, elsewhere=(elsewhere,))[0]
    assert 4 == checked(log, owner, key, elsewhere=(elsewhere / made.name,))[0]


def test_a_number_that_nothing_comes_before(log: Path, key: SigningKey, owner: SigningKey) -> None:
    """Where nothing of the key lies there, no statement can be named as the last that counts."""
    with pytest.raises(SigningError, match="number below 2, got none"):
        revoke(log, owner, public(key), first=2)
    assert not (log / "signatures").exists()


@needs_ssh_keygen
def test_ssh_keygen_checks_a_revocation(log: Path, key: SigningKey, owner: SigningKey) -> None:
    """As docs/guides/signatures.md says."""
    sign(log, key)
    made = revoke(log, owner, public(key), first=2)
    assert made.read_text() == Revocation(
        last_signed(log, 1).log_id, public(key).words, 2, signed_in(log)[1].digest
    ).text  # fmt: skip
    allowed = log.parent / "allowed_signers"
    allowed.write_text(f"owner {public(owner).line}")

    subprocess.run(
        ["ssh-keygen", "-Y", "verify", "-f", allowed, "-I", "owner", "-n", REVOKING,
         "-s", f"{made}.sig"],
        input=made.read_bytes(), capture_output=True, check=True,
    )  # fmt: skip
