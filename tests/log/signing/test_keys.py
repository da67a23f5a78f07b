"""Keys: private ones that nobody else can read, and public ones that are believed as written."""

from __future__ import annotations

import base64
import os
import stat
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest

from semmap_log.errors import PassphraseError, SigningError
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import make_key, read_key, sign
from semmap_log.log.signing.statement import read_public_keys
from tests.log.signing.signed_logs import a_key, needs_ssh_keygen


def test_a_new_key_is_its_owner_s_alone_from_the_first_instant(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the umask: the file is made with its mode, not changed later."""
    made: dict[str, tuple[int, int]] = {}
    really = os.open

    def watched(path, flags, mode=0o777, **where):  # type: ignore[no-untyped-def]
        fd = really(path, flags, mode, **where)
        if flags & os.O_CREAT:
            made[Path(path).name] = (flags & os.O_EXCL, stat.S_IMODE(os.fstat(fd).st_mode))
        return fd

    monkeypatch.setattr(os, "open", watched)
    before = os.umask(0)
    try:
        a_key(tmp_path)
    finally:
        os.umask(before)

    assert made == {"robot": (os.O_EXCL, 0o600), "robot.pub": (os.O_EXCL, 0o644)}
    assert stat.S_IMODE((tmp_path / "robot").stat().st_mode) == 0o600


@pytest.mark.parametrize("there", ["robot", "robot.pub"])
@pytest.mark.parametrize("as_link", [False, True])
def test_no_key_is_replaced(tmp_path: Path, there: str, *, as_link: bool) -> None:
    """Neither of the two files, nor through a link that leads nowhere; and no half pair is left."""
    if as_link:
        (tmp_path / there).symlink_to("elsewhere")
    else:
        (tmp_path / there).write_text("mine")

    with pytest.raises(SigningError, match=f"{there}: is there already"):
        a_key(tmp_path)

    assert [there] == [path.name for path in tmp_path.iterdir()]


@pytest.mark.parametrize("name", ["key", "signatures/key", "../log/key"])
def test_no_key_lies_in_the_log(log: Path, key: SigningKey, tmp_path: Path, name: str) -> None:
    """It would be copied with the log; neither a new one nor one that is there."""
    sign(log, key)
    with pytest.raises(SigningError, match="lies in the log's own folder"):
        make_key(log / name, log=log)
    assert not (log / name).exists()

    (tmp_path / "robot").rename(log / name)
    with pytest.raises(SigningError, match="lies in the log's own folder"):
        read_key(log / name, log=log)
    (tmp_path / "link").symlink_to(log / name)
    with pytest.raises(SigningError, match="lies in the log's own folder"):
        read_key(tmp_path / "link", log=log)


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o644, 0o660, 0o601])
def test_a_key_that_others_can_read_is_refused(key: SigningKey, tmp_path: Path, mode: int) -> None:
    (tmp_path / "robot").chmod(mode)

    with pytest.raises(SigningError, match=f"others may read .*mode {mode:04o}.*chmod 600"):
        read_key(tmp_path / "robot", log=tmp_path / "log")


def test_no_byte_of_the_private_key_is_in_the_log(
    log: Path, key: SigningKey, tmp_path: Path
) -> None:
    """Neither its 32 bytes nor any line of its file."""
    sign(log, key)
    text = (tmp_path / "robot").read_bytes()
    packed = base64.b64decode(b"".join(text.splitlines()[1:-1]))
    place = packed.rindex(key.public_bytes) - 32  # OpenSSH writes the seed, then the public key
    seed = packed[place : place + 32]
    assert SigningKey.of_openssh(text).public_bytes == key.public_bytes

    found = [file.read_bytes() for file in log.rglob("*") if file.is_file()]

    assert len(found) > 6
    for secret in (seed, seed.hex().encode(), base64.b64encode(seed)[:40], *text.splitlines()[2:]):
        assert not any(secret in each for each in found)


@needs_ssh_keygen
def test_keys_of_ssh_keygen_sign(log: Path, tmp_path: Path) -> None:
    """And it finds in ours the public key that lies beside it."""
    _keygen(tmp_path / "theirs")
    a_key(tmp_path, "ours")

    assert len(sign(log, read_key(tmp_path / "theirs", log=log)).made) == 3
    said = subprocess.run(
        ["ssh-keygen", "-y", "-f", tmp_path / "ours"], capture_output=True, check=True
    )
    ours = (tmp_path / "ours.pub").read_bytes()
    assert said.stdout.split()[:2] == ours.split()[:2]


@needs_ssh_keygen
@pytest.mark.skipif(find_spec("bcrypt") is None, reason="needs bcrypt")
def test_a_key_with_a_passphrase(log: Path, tmp_path: Path) -> None:
    """It is asked for once, and only of a key that has one."""
    _keygen(tmp_path / "locked", "open sesame")
    a_key(tmp_path)
    asked: list[str] = []

    def ask() -> str:
        asked.append("once")
        return "open sesame"

    assert sign(log, read_key(tmp_path / "locked", log=log, passphrase=ask)).made
    assert ["once"] == asked
    read_key(tmp_path / "robot", log=log, passphrase=ask)
    assert ["once"] == asked
    with pytest.raises(PassphraseError, match="locked: it is encrypted"):
        read_key(tmp_path / "locked", log=log)
    with pytest.raises(PassphraseError, match="cannot be opened with this passphrase"):
        read_key(tmp_path / "locked", log=log, passphrase=lambda: "sesame")


@needs_ssh_keygen
def test_a_key_of_another_kind_is_refused(tmp_path: Path) -> None:
    _keygen(tmp_path / "rsa", kind="rsa")

    with pytest.raises(SigningError, match="expected a key of Ed25519"):
        read_key(tmp_path / "rsa", log=tmp_path / "log")
    with pytest.raises(SigningError, match=r"1: expected `ssh-ed25519 BASE64`"):
        read_public_keys([tmp_path / "rsa.pub"])


@pytest.mark.parametrize("data", [b"", b"hello", b"-----BEGIN OPENSSH PRIVATE KEY-----\nAAAA\n"])
def test_what_is_no_key_is_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "key").write_bytes(data)
    (tmp_path / "key").chmod(0o600)

    with pytest.raises(SigningError, match="key: "):
        read_key(tmp_path / "key", log=tmp_path / "log")


def test_public_keys_are_read_as_ssh_reads_them(tmp_path: Path) -> None:
    """From a `.pub`, or from lines of allowed_signers with their principals and namespaces."""
    keys = [a_key(tmp_path, name) for name in ("a", "b", "c")]
    lines = [(tmp_path / f"{name}.pub").read_text().rsplit(" ", 1)[0] for name in ("a", "b", "c")]
    path = tmp_path / "allowed"
    path.write_text(
        "# who\n\n"
        f'me@here {lines[0]}\nx,y namespaces="git,semmap-*" {lines[1]} of b\n{lines[2]} c\n'
    )

    found = read_public_keys([path])

    assert [key.public_bytes for key in keys] == list(found)
    assert ["me@here", "x,y", "c"] == [key.owner for key in found.values()]


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ('me namespaces="git" %', "allow none of semmap-log, semmap-log-trim, semmap-log-revoke"),
        ('me valid-before="20200101" %', "only namespaces="),
        ("me cert-authority %", "only namespaces="),
        ("ssh-ed25519 AAAA", "expected `ssh-ed25519 BASE64`"),
        ("hello", "expected `ssh-ed25519 BASE64`"),
        ("", "expected a public key"),
        ("-----BEGIN OPENSSH PRIVATE KEY-----", "expected a public key, got a private one"),
    ],
)
def test_what_is_not_understood_is_not_believed(tmp_path: Path, line: str, problem: str) -> None:
    a_key(tmp_path)
    public = (tmp_path / "robot.pub").read_text().rsplit(" ", 1)[0]
    (tmp_path / "keys").write_text(line.replace("%", public) + "\n")

    with pytest.raises(SigningError, match=problem):
        read_public_keys([tmp_path / "keys"])


def test_no_byte_of_a_public_key_may_differ(key: SigningKey, tmp_path: Path) -> None:
    """It is another key then, or none."""
    path = tmp_path / "robot.pub"
    whole = path.read_bytes().rsplit(b" ", 1)[0]
    for place in range(len(whole)):
        for bit in range(8):
            flipped = bytearray(whole)
            flipped[place] ^= 1 << bit
            path.write_bytes(flipped)
            try:
                found = read_public_keys([path])
            except SigningError:
                continue
            assert key.public_bytes not in found, (place, bit)


def _keygen(path: Path, passphrase: str = "", kind: str = "ed25519") -> None:
    subprocess.run(
        ["ssh-keygen", "-q", "-t", kind, "-N", passphrase, "-f", path],
        check=True, stdin=subprocess.DEVNULL,
    )  # fmt: skip
