"""Logs, keys and the system's ssh-keygen, for the tests of this room."""

from __future__ import annotations

import hashlib
import json
import shutil
import struct
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import make_key, sign
from semmap_log.log.signing.signed_log import SignedVerification, verify_signed
from semmap_log.log.signing.statement import PublicKey
from semmap_log.store.verification import Severity

needs_ssh_keygen = pytest.mark.skipif(
    shutil.which("ssh-keygen") is None, reason="needs OpenSSH's ssh-keygen"
)


def a_key(folder: Path, name: str = "robot") -> SigningKey:
    """Make a key pair in a folder outside of the log."""
    return make_key(folder / name, log=folder / "log", comment=name)


def believed(*keys: SigningKey) -> dict[bytes, PublicKey]:
    """Return these as the keys to believe."""
    return {key.public_bytes: PublicKey(key.public_bytes, f"key {i}") for i, key in enumerate(keys)}


def checked(
    log: Path, *keys: SigningKey, elsewhere: Sequence[Path] = ()
) -> tuple[int, list[str], SignedVerification]:
    """Verify a log; return the exit code, the kinds of what is not as signed, and all."""
    done = verify_signed(log, believed(*keys), elsewhere=elsewhere)
    kinds = [one.kind for one in done.found.of(Severity.NOT_AS_SIGNED, Severity.UNSIGNED)]
    return done.found.exit_code, kinds, done


def is_good(log: Path, key: SigningKey) -> bool:
    """Tell whether nothing is wrong with a log, and all that is closed is signed."""
    return checked(log, key)[0] == 0


def statements(log: Path) -> list[Path]:
    """Return a log's statements, the first first."""
    return sorted((log / "signatures").glob("*.head"))


@contextmanager
def state_of(key: SigningKey) -> Iterator[SigningKey]:
    """Hand out the key; afterwards it knows again what it knew before: a clone of it did that."""
    assert key.path is not None
    file = key.path.with_name(key.path.name + ".state")
    before = file.read_bytes()
    try:
        yield key
    finally:
        file.write_bytes(before)


def forget(key: SigningKey, log: Path) -> None:
    """Remove a log's signatures, and what the key knows of them."""
    assert key.path is not None
    key.path.with_name(key.path.name + ".state").unlink(missing_ok=True)
    shutil.rmtree(log / "signatures", ignore_errors=True)


def nothing_taken_out(timezone: str, building: str, robot: str) -> str:
    """Return `taken` of a log that is whole, as docs/log_format.md says."""
    said = json.dumps([timezone, building, robot], separators=(",", ":")).encode()
    item = b"i" + struct.pack("<Q", len(said)) + said
    return hashlib.sha256(b"semmap-log taken 1\n" + item).hexdigest()


def ssh_verifies(key: SigningKey, statement: Path, *, folder: Path) -> bool:
    """Ask ssh-keygen whether a signature is that of a key."""
    allowed = folder / "allowed_signers"
    allowed.write_text(f"robot {PublicKey(key.public_bytes).line}")
    done = subprocess.run(
        ["ssh-keygen", "-Y", "verify", "-f", allowed, "-I", "robot", "-n", "semmap-log",
         "-s", f"{statement}.sig"],
        input=statement.read_bytes(), capture_output=True, check=False,
    )  # fmt: skip
    return done.returncode == 0


__all__ = [
    "a_key", "believed", "checked", "forget", "is_good", "needs_ssh_keygen", "nothing_taken_out",
    "sign", "ssh_verifies", "state_of", "statements",
]  # fmt: skip
