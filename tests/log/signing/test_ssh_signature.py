"""Signatures in OpenSSH's form: ssh-keygen reads ours, we read its, and no byte may differ."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import sign
from semmap_log.log.signing.signature_folder import BadSignature, SignedStatement, read_signed
from semmap_log.log.signing.statement import PublicKey, fingerprint, read_signature, signature_of
from tests.log.signing.signed_logs import is_good, needs_ssh_keygen, ssh_verifies, statements

TEXT = b"a door was open\n"


@needs_ssh_keygen
def test_ssh_keygen_checks_our_signatures(log: Path, key: SigningKey, tmp_path: Path) -> None:
    """Each of them, and not for another text."""
    sign(log, key)
    files = statements(log)

    assert [True] * 3 == [ssh_verifies(key, file, folder=tmp_path) for file in files]
    files[0].write_bytes(files[1].read_bytes())
    assert not ssh_verifies(key, files[0], folder=tmp_path)


@needs_ssh_keygen
@pytest.mark.parametrize("options", [(), ("-O", "hashalg=sha256")])
def test_we_check_signatures_of_ssh_keygen(
    log: Path, key: SigningKey, tmp_path: Path, options: tuple[str, ...]
) -> None:
    """Made with our key's file; with its usual hash the file is ours, byte for byte."""
    sign(log, key)
    for file in statements(log):
        ours = Path(f"{file}.sig")
        before = ours.read_bytes()
        ours.unlink()
        _ssh_sign(tmp_path / "robot", file, "semmap-log", *options)
        assert (ours.read_bytes() == before) == (not options)

    assert is_good(log, key)


@needs_ssh_keygen
def test_a_signature_for_another_purpose_is_none(
    log: Path, key: SigningKey, tmp_path: Path
) -> None:
    """The same text and key, signed as a file or a commit of git."""
    sign(log, key)
    file = statements(log)[0]
    Path(f"{file}.sig").unlink()
    _ssh_sign(tmp_path / "robot", file, "file")

    found = read_signed(file)

    assert isinstance(found, BadSignature)
    assert (
        "expected the namespace semmap-log or semmap-log-trim or semmap-log-revoke, got 'file'"
        in found.problem
    )


@needs_ssh_keygen
def test_a_fingerprint_is_that_of_ssh_keygen(key: SigningKey, tmp_path: Path) -> None:
    said = subprocess.run(
        ["ssh-keygen", "-l", "-f", tmp_path / "robot.pub"], capture_output=True, check=True
    )

    assert said.stdout.split()[1].decode() == fingerprint(key.public_bytes)


def test_no_byte_of_a_statement_or_signature_may_differ(log: Path, key: SigningKey) -> None:
    """Whichever bit of it: it is not signed, or not a statement, any more."""
    sign(log, key)
    statement = statements(log)[-1]
    for file in (statement, Path(f"{statement}.sig")):
        whole = file.read_bytes()
        for place in range(len(whole)):
            for bit in range(8):
                flipped = bytearray(whole)
                flipped[place] ^= 1 << bit
                file.write_bytes(flipped)
                assert isinstance(read_signed(statement), BadSignature), (file.name, place, bit)
        for extra in (
            whole[:-1],
            whole + b"\n",
            b"\n" + whole,
            whole * 2,
            b"",
            whole[:40] + b"\n" + whole[40:],
            whole.partition(b"\n")[2],
        ):
            file.write_bytes(extra)
            assert isinstance(read_signed(statement), BadSignature)
        file.write_bytes(whole)
    assert isinstance(read_signed(statement), SignedStatement)


def test_a_signature_fits_one_text_and_one_key() -> None:
    """And is the same each time, so that who signs at the same time as another writes the same."""
    one, other = SigningKey.drawn(), SigningKey.drawn()

    found = read_signature(signature_of(TEXT, one))

    assert found.fits(TEXT)
    assert not found.fits(TEXT + b" ")
    assert found.public_bytes == one.public_bytes != other.public_bytes
    assert signature_of(TEXT, one) == signature_of(TEXT, one) != signature_of(TEXT, other)


def test_the_public_key_s_line_is_that_of_its_file(key: SigningKey, tmp_path: Path) -> None:
    assert PublicKey(key.public_bytes, "robot").line == (tmp_path / "robot.pub").read_text()


def _ssh_sign(key: Path, file: Path, namespace: str, *options: str) -> None:
    subprocess.run(
        ["ssh-keygen", "-Y", "sign", "-f", key, "-n", namespace, *options, file],
        capture_output=True, check=True,
    )  # fmt: skip
