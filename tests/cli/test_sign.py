"""`sign`, `verify --public-key` and `--sign-key` as a user types them."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import semmap_log as sl
from semmap_log.log.signing.log_signing import make_key
from tests.live.ros.running import wait_until
from tests.log.signing.authority import Authority, needs_openssl, served
from tests.store.eventful import eventful_log, flip
from tests.verbs import Refuses, ran

LINE = '{"kind": "DoorObserved", "door": "front", "state": "OPEN"}\n'
BAD_LINE = '{"kind": "DoorObserved", "door": "nowhere", "state": "OPEN"}\n'


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return eventful_log(tmp_path_factory.mktemp("original") / "log")


@pytest.fixture
def log(original: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy to sign; the folder above is where commands run."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("SEMMAP_LOG_KEY_PASSPHRASE", raising=False)
    return Path(shutil.copytree(original, tmp_path / "log"))


def test_a_key_a_signature_and_its_check(log: Path, capsys) -> None:
    """The three commands of the guide, each with what it says; 80 columns are enough."""
    code, out, err = ran(capsys, "sign", "log", "--key", "key", "--new-key")
    assert code == 0
    assert out.startswith("log: 3 new signatures; signed up to event 12 by SHA256:")
    assert err == "key: a new private key; keep it from others. Whom to believe: key.pub\n"

    code, again, _ = ran(capsys, "sign", "log", "--key", "key")
    assert (0, out.replace("3 new signatures", "nothing new to sign")) == (code, again)

    code, out, err = ran(capsys, "verify", "log", "--public-key", "key.pub")
    lines = out.splitlines()
    assert (0, "") == (code, err)
    assert lines[0].startswith("log: good; 13 events in 11 commits")
    assert lines[1] == "signed up to event 12; 3 of 3 statements good"
    assert lines[2].startswith("  by ")
    assert all(len(line) <= 80 for line in lines)


def test_json(log: Path, capsys) -> None:
    """What was signed, by which key; and what its check shows."""
    said = json.loads(ran(capsys, "sign", "log", "--key", "k", "--new-key", "--json")[1])
    assert said == {
        "key": said["key"],
        "made": sorted(path.name for path in log.glob("signatures/*.head")),
        "signed_before": 13,
        "live": False,
    }

    found = json.loads(ran(capsys, "verify", "log", "--public-key", "k.pub", "--json")[1])

    assert ("good", 0) == (found["verdict"], found["exit_code"])
    assert found["signatures"] == {
        "statements": 3,
        "good": 3,
        "signed_before": 13,
        "by": [{"key": said["key"], "owner": found["signatures"]["by"][0]["owner"]}],
        "timestamps": [
            {"statement": str(path), "time": None}
            for path in sorted(Path("log").glob("signatures/*.head"))
        ],
    }
    assert "signatures" not in json.loads(ran(capsys, "verify", "log", "--json")[1])


def test_a_key_is_revoked(log: Path, capsys) -> None:
    """With the owner's key in an allowed_signers file, for that; as the guide says."""
    ran(capsys, "sign", "log", "--key", "robot", "--new-key")
    make_key(Path("owner"), log=log)
    robot, owner = Path("robot.pub").read_text(), Path("owner.pub").read_text()
    Path("believed").write_text(f'{robot}o namespaces="semmap-log-revoke" {owner}')

    code, out, err = ran(
        capsys, "sign", "log", "--key", "owner", "--revoke", "robot.pub", "--from", "2"
    )

    assert (0, "") == (code, err)
    assert "is revoked from its statement 2 on" in out
    code, out, _ = ran(capsys, "verify", "log", "--public-key", "believed")
    assert code == 4
    assert "not as signed  " in out
    assert "was revoked by o (SHA256:" in " ".join(out.split())
    said = json.loads(ran(capsys, "verify", "log", "--public-key", "believed", "--json")[1])
    assert {"revoked", "unsigned"} == {one["kind"] for one in said["findings"]}
    assert (3, 2) == (said["signatures"]["statements"], said["signatures"]["good"])
    for words in (("--revoke", "robot.pub"), ("--from", "2"),
                  ("--revoke", "robot.pub", "--from", "2", "--adopt")):  # fmt: skip
        assert 2 == ran(capsys, "sign", "log", "--key", "owner", *words)[0]


@needs_openssl
def test_a_time_stamp_is_kept(log: Path, tmp_path: Path, capsys) -> None:
    """Also by a later command, if the authority did not answer."""
    authority = Authority(tmp_path / "tsa")
    with served(lambda _: b"nothing") as (url, _):
        code, out, err = ran(capsys, "sign", "log", "--key", "k", "--new-key", "--timestamp", url)
    assert code == 1
    assert out.startswith("log: 3 new signatures")
    assert "What is signed stays signed" in err

    with served(authority.answer) as (url, _):
        code, out, err = ran(capsys, "sign", "log", "--key", "k", "--timestamp", url)

    assert (0, True) == (code, out.startswith("log: nothing new to sign"))
    (token,) = log.glob("signatures/*.head.tsr")
    assert err.startswith(f"{token.name}: time stamp of 20")
    assert "OK" == authority.verifies(token.with_suffix(""), token)
    out = ran(capsys, "verify", "log", "--public-key", "k.pub")[1]
    assert "1 time stamp; openssl ts -verify checks whose" in out
    assert 2 == ran(capsys, "sign", "log", "--key", "k", "--timestamp", "tsa.example")[0]


def test_what_is_not_as_signed_is_told_with_exit_code_4(log: Path, capsys) -> None:
    ran(capsys, "sign", "log", "--key", "k", "--new-key")
    last = max(log.glob("signatures/*.head"))
    last.write_text(last.read_text().replace("commits: 11", "commits: 9"))

    code, out, _ = ran(capsys, "verify", "log", "--public-key", "k.pub")

    assert code == 4
    assert out.startswith("log: not as signed; 13 events")
    assert "one of the two was altered" in " ".join(out.split())
    assert "To do: where only signatures are missing" in out
    said = json.loads(ran(capsys, "verify", "log", "--public-key", "k.pub", "--json")[1])
    assert ["signature", "unsigned"] == [one["kind"] for one in said["findings"]]
    assert ["not_as_signed", "unsigned"] == [one["severity"] for one in said["findings"]]
    assert 0 == ran(capsys, "verify", "log")[0]


def test_a_damaged_log_is_damaged_first(log: Path, capsys) -> None:
    ran(capsys, "sign", "log", "--key", "k", "--new-key")
    file = min(log.glob("*.mcap"))
    flip(file, file.stat().st_size // 2)

    code, out, _ = ran(capsys, "verify", "log", "--public-key", "k.pub")

    assert code == 4
    assert out.startswith("log: damaged; ")


def test_what_cannot_be_is_said(log: Path, capsys, refuses: Refuses) -> None:
    """In one message, without a traceback; and no key is made for no log."""
    ran(capsys, "sign", "log", "--key", "k", "--new-key")

    refuses("""
        verify log --signatures log/signatures
        verify log/log_000000.mcap --public-key k.pub
        verify log --public-key nothing.pub
        verify log --public-key k
        verify log --public-key k.pub --signatures no
        sign log
        sign log --key nothing
        sign log --key k --new-key
        sign nolog --key k
        sign nolog --key k2 --new-key
        record log --sign-key nothing
        record log --ros2 --dry-run --sign-key k
        serve log --ask unix:s --sign-key no
        serve log --ask unix:s --read-only --sign-key k
    """)

    assert not Path("k2").exists()


def test_the_passphrase_comes_from_the_environment(
    log: Path, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where there is no terminal to ask at."""
    pytest.importorskip("bcrypt")
    if shutil.which("ssh-keygen") is None:
        pytest.skip("needs OpenSSH's ssh-keygen")
    subprocess.run(
        ["ssh-keygen", "-q", "-t", "ed25519", "-N", "sesame", "-f", "locked"], check=True
    )

    code, _, err = ran(capsys, "sign", "log", "--key", "locked")
    assert (1, "semmap-log: locked: it is encrypted; its passphrase is needed.") == (
        code, err.strip(),
    )  # fmt: skip
    monkeypatch.setenv("SEMMAP_LOG_KEY_PASSPHRASE", "sesame")
    assert 0 == ran(capsys, "sign", "log", "--key", "locked")[0]


@pytest.mark.parametrize(("lines", "code"), [(LINE * 3, 0), (LINE + BAD_LINE, 1)])
def test_record_signs_what_it_closes(log: Path, capsys, lines: str, code: int) -> None:
    """Also where a bad line makes the exit code."""
    ran(capsys, "sign", "log", "--key", "k", "--new-key")

    done = _run(["record", "log", "--sign-key", "k"], lines)

    last = 12 + lines.count("front")
    assert code == done.returncode
    assert f"log: signed up to event {last}." in done.stderr
    assert 0 == ran(capsys, "verify", "log", "--public-key", "k.pub")[0]


def test_record_goes_on_where_it_cannot_sign(log: Path, capsys) -> None:
    """It says so once, and how to sign later."""
    ran(capsys, "sign", "log", "--key", "k", "--new-key")
    (log / "signatures").rename("kept")
    (log / "signatures").write_text("in the way")

    done = _run(["record", "log", "--sign-key", "k"], LINE * 3)

    assert done.returncode == 0
    assert "log: 3 events recorded." in done.stderr
    assert 1 == done.stderr.count("not signed:")
    assert "To sign it: semmap-log sign log --key KEY" in done.stderr
    (log / "signatures").unlink()
    Path("kept").rename(log / "signatures")
    assert 0 == ran(capsys, "sign", "log", "--key", "k")[0]
    assert 0 == ran(capsys, "verify", "log", "--public-key", "k.pub")[0]


def test_serve_signs_what_it_closes(log: Path, capsys) -> None:
    """A planner sets a door; at the end that is signed, too."""
    ran(capsys, "sign", "log", "--key", "k", "--new-key")
    line = [
        sys.executable,
        "-m",
        "semmap_log",
        "serve",
        "log",
        "--ask",
        "unix:s",
        "--sign-key",
        "k",
    ]
    server = subprocess.Popen(line, stderr=subprocess.PIPE, text=True)
    try:
        wait_until(lambda: Path("s").exists() or server.poll(), "the socket")
        before = len(list(sl.read(log).history()))
        asked = _run(["ask", "unix:s", "SET_DOOR_CLOSED DOOR_front"], "")
        assert asked.returncode == 0, asked
    finally:
        server.send_signal(signal.SIGTERM)
        _, said = server.communicate(timeout=100)

    assert server.returncode == 0
    assert before < len(list(sl.read(log).history()))
    assert "log: signed up to event" in said
    assert 0 == ran(capsys, "verify", "log", "--public-key", "k.pub")[0]


def _run(words: list[str], lines: str) -> subprocess.CompletedProcess[str]:
    environment: dict[str, Any] = {**os.environ, "COLUMNS": "80"}
    return subprocess.run(
        [sys.executable, "-m", "semmap_log", *words],
        input=lines, capture_output=True, text=True, env=environment, check=False,
    )  # fmt: skip


def test_an_unsigned_end_is_exit_code_6_and_who_may_adopt_it(log: Path, capsys) -> None:
    """A recorder refuses what it has not written, adopts it if it is told to, and signs often."""
    ran(capsys, "sign", "log", "--key", "k", "--new-key")
    assert 0 == ran(capsys, "observe", "log", "front", "open")[0]
    code, out, _ = ran(capsys, "verify", "log", "--public-key", "k.pub")
    assert code == 6
    assert out.startswith("log: unsigned end; ")
    assert "1 event at the end without a signature" in " ".join(out.split())
    allowed = ("verify", "log", "--public-key", "k.pub", "--allow-unsigned-end")
    assert 0 == ran(capsys, *allowed)[0]
    said = json.loads(ran(capsys, "verify", "log", "--public-key", "k.pub", "--json")[1])
    assert (6, "unsigned end") == (said["exit_code"], said["verdict"])
    assert ["unsigned"] == [one["severity"] for one in said["findings"]]

    refused = _run(["record", "log", "--sign-key", "k"], LINE)
    assert "events 13..13 are not signed, and no recorder with this key wrote" in refused.stderr
    assert 6 == ran(capsys, "verify", "log", "--public-key", "k.pub")[0]
    adopting = _run(["record", "log", "--sign-key", "k", "--adopt", "--sign-every", "1s"], LINE)
    assert "log: signed up to event 15." in adopting.stderr
    code, out, _ = ran(capsys, "verify", "log", "--public-key", "k.pub")
    assert (6, True) == (code, "adopted  " in out or "events 13..14" in out)
    assert 0 == ran(capsys, "verify", "log")[0]
    assert 2 == _run(["record", "log", "--adopt"], "").returncode
    assert 2 == _run(["record", "log", "--sign-key", "k", "--sign-every", "often"], "").returncode


def test_an_officer_s_key_vouches_for_what_is_taken_out(log: Path, capsys) -> None:
    """`redact --sign-key`; a file of allowed signers says who may."""
    ran(capsys, "sign", "log", "--key", "robot", "--new-key")
    ran(capsys, "init", "elsewhere", "--tz", "UTC")
    ran(capsys, "sign", "elsewhere", "--key", "officer", "--new-key")
    lines = [
        f'{who} namespaces="{what}" {Path(who + ".pub").read_text()}'
        for who, what in (("robot", "semmap-log"), ("officer", "semmap-log-trim"))
    ]
    Path("allowed").write_text("".join(lines))
    line = ("redact", "log", "--notes", "--by", "me", "--sign-key", "officer")
    assert 0 == ran(capsys, *line, "--dry-run")[0]
    assert [] == list(log.glob("signatures/*.trim"))
    assert 0 == ran(capsys, *line)[0]

    assert 1 == len(list(log.glob("signatures/*.trim")))
    assert 0 == ran(capsys, "verify", "log", "--public-key", "allowed")[0]
    code, out, _ = ran(capsys, "verify", "log", "--public-key", "robot.pub")
    assert (4, True) == (code, "not vouched for: " in out)
    ran(capsys, "retain", "log", "--thin", "0d")
    code, out, err = ran(capsys, "retain", "log", "--keep", "0d", "--sign-key", "officer")
    assert (1, True) == (code, "no officer's statement vouches for that" in err) or code == 0
    assert 0 == ran(capsys, "sign", "log", "--key", "officer", "--adopt")[0]
    assert 0 == ran(capsys, "verify", "log", "--public-key", "allowed")[0]
