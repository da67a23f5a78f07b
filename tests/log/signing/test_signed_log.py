"""What signatures show: a log that was rolled back, rewritten, forked, or signed by others."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import pytest

import semmap_log as sl
from semmap_log.log.replay.maintenance import recover, verify
from semmap_log.log.signing.ed25519_sdk import SigningKey
from semmap_log.log.signing.log_signing import sign
from semmap_log.log.signing.signed_log import verify_signed
from semmap_log.store.compaction import compact
from semmap_log.store.verification import Severity
from semmap_log.store.writing import segment_chain
from tests.log.signing.signed_logs import (
    a_key,
    believed,
    checked,
    is_good,
    nothing_taken_out,
    statements,
)
from tests.store.eventful import eventful_log, flip
from tests.store.logs import answers, segment_files


def observed(log: Path, state: str, count: int = 1) -> Path:
    """Append sightings, each time in another segment; return the log."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(segment_chain, "CONTINUE_BELOW_BYTES", 1)
        for _ in range(count):
            with sl.append(log, compact=False) as opened:
                opened.observe("front", state)
    return log


def test_a_signed_log_is_good(log: Path, key: SigningKey) -> None:
    """Each closed segment has its statement; the log's own files are as they were."""
    before = {path.name: path.read_bytes() for path in log.iterdir()}

    done = sign(log, key)

    code, wrong, found = checked(log, key)
    assert (0, []) == (code, wrong)
    assert (3, 3, 13) == (found.statements, found.good, found.signed_before)
    assert [key.public_bytes] == [one.public_bytes for one in found.by]
    assert done.made == statements(log)
    assert before == {path.name: path.read_bytes() for path in log.iterdir() if path.is_file()}


def test_what_a_statement_says_is_what_the_log_holds(log: Path, key: SigningKey) -> None:
    """Counted by the commits that a reader of the log gives."""
    sign(log, key)
    commits = list(sl.read(log).commits())

    texts = [file.read_text() for file in statements(log)]
    said = [dict(line.split(": ") for line in text.splitlines()[1:]) for text in texts]
    inside = [[c for c in commits if c.first_event < int(one["next-event"])] for one in said]
    assert [str(len(commits)) for commits in inside] == [one["commits"] for one in said]
    assert [commits[-1].hash.hex() for commits in inside] == [one["head"] for one in said]
    assert ["0", "1", "2"] == [one["number"] for one in said]
    digests = [hashlib.sha256(text.encode()).hexdigest() for text in texts]
    assert ["0" * 64, *digests[:-1]] == [one["before"] for one in said]
    assert {nothing_taken_out("UTC", "", "")} == {one["taken"] for one in said}


def test_signing_again_signs_what_is_new(log: Path, key: SigningKey) -> None:
    """Also what was added to a small segment that was signed before; old statements stay good."""
    sign(log, key)
    assert [] == sign(log, key).made
    with sl.append(log) as opened:
        opened.observe("front", "open")

    code, wrong, _ = checked(log, key)
    assert (6, ["unsigned"]) == (code, wrong)

    assert 1 == len(sign(log, key).made)
    assert is_good(log, key)
    assert 4 == len(statements(log))


def test_a_live_segment_is_signed_once_it_is_closed(live: Path, key: SigningKey) -> None:
    """Until then it is an unsigned end; who allows that is told so in a note."""
    done = sign(live, key)

    assert done.is_live
    code, wrong, found = checked(live, key)
    assert (6, ["unsigned"]) == (code, wrong)
    allowed = verify_signed(live, believed(key), allow_unsigned_end=True).found
    assert 0 == allowed.exit_code
    notes = [one for one in allowed.of(Severity.NOTE) if one.kind == "unsigned"]
    assert [(done.next_event, found.found.next_event - 1)] == [one.events for one in notes]
    assert "3 events at the end" in notes[0].text


def test_a_fork_is_not_signed_by_the_same_key(
    log: Path, earlier: Path, key: SigningKey, tmp_path: Path
) -> None:
    """Neither a log that was rolled back, nor one that was rewritten: the key knows better."""
    sign(log, key)
    shutil.copytree(log / "signatures", earlier / "signatures")
    with sl.append(earlier, compact=False):
        pass
    other = eventful_log(tmp_path / "other", accuracy=0.8)
    shutil.copytree(log / "signatures", other / "signatures")

    with pytest.raises(sl.errors.SigningError, match="rolled back, or cut"):
        sign(earlier, key)
    with pytest.raises(sl.errors.SigningError, match="rewritten, or is another branch"):
        sign(other, key)
    observed(other, "open", 2)
    with pytest.raises(sl.errors.SigningError, match="rewritten, or is another branch"):
        sign(other, key)
    done = sign(other, key, adopt=True)
    assert (0, 14) == done.adopted
    assert {"rewritten", "adopted"} <= set(checked(other, key)[1])


def test_an_unknown_signer_shows(log: Path, key: SigningKey, tmp_path: Path) -> None:
    """Signed well, by somebody who is not believed; of two, both may be."""
    sign(log, key)
    stranger = a_key(tmp_path, "stranger")
    sign(log, stranger)

    assert (4, ["signer"] * 3) == checked(log, key)[:2]
    assert 0 == checked(log, key, stranger)[0]
    nobody = a_key(tmp_path, "nobody")
    assert (4, ["signer"] * 6 + ["unsigned"]) == checked(log, nobody)[:2]


def test_an_altered_statement_shows(log: Path, key: SigningKey) -> None:
    """Its text, its signature, one in the place of another, or a signature that is gone."""
    sign(log, key)
    first, second, last = statements(log)
    whole = last.read_text()

    last.write_text(whole.replace("commits: 1", "commits: 4"))
    assert (4, ["signature", "unsigned"]) == checked(log, key)[:2]
    last.write_text(f"{whole}also: this\n")
    assert (4, ["statement", "unsigned"]) == checked(log, key)[:2]
    last.write_text(whole)
    flip(Path(f"{first}.sig"), 100)
    assert ["signature", "statement"] == checked(log, key)[1]  # the second one follows it
    shutil.copy(f"{second}.sig", f"{first}.sig")
    assert ["signature", "statement"] == checked(log, key)[1]
    Path(f"{first}.sig").unlink()
    assert ["signature", "statement"] == checked(log, key)[1]


def test_a_changed_byte_of_the_log_is_damage_as_ever(log: Path, key: SigningKey) -> None:
    """Signatures are asked beside all else that is checked; a damaged log is not signed."""
    file = segment_files(log)[1]
    flip(file, file.stat().st_size // 2)

    with pytest.raises(sl.errors.SigningError, match="not signed"):
        sign(log, key)

    assert [] == statements(log)
    assert checked(log, key)[2].found.of(Severity.DAMAGE)


@pytest.mark.parametrize("how", ["compact", "merge", "recover"])
def test_signatures_outlive_the_care_of_a_log(log: Path, key: SigningKey, how: str) -> None:
    """Compaction and merges change no hash; a recovery of what is whole adds one event."""
    sign(log, key)
    if how == "recover":
        for mark in log.glob("closed-*.json"):
            mark.write_text("{}")
        assert verify(log).exit_code == 4
        recover(log)
        assert ["unsigned"] == checked(log, key)[1]
    else:
        compact(log, merge=how == "merge", keep_s=0)
        assert len(segment_files(log)) == (1 if how == "merge" else 3)

    assert (how == "recover") == len(sign(log, key).made)
    assert is_good(log, key)
    observed(log, "open")
    assert 1 == len(sign(log, key).made)
    assert is_good(log, key)


def test_one_of_many_places_and_files(log: Path, key: SigningKey, tmp_path: Path) -> None:
    """What is kept elsewhere may be a folder or a single statement; a zip has only that."""
    sign(log, key)
    kept = Path(shutil.copytree(log / "signatures", tmp_path / "kept"))
    shutil.rmtree(log / "signatures")

    assert 0 == checked(log, key, elsewhere=[kept])[0]
    assert 0 == checked(log, key, elsewhere=sorted(kept.glob("*.head")))[0]
    assert (4, ["unsigned"]) == checked(log, key)[:2]
    with pytest.raises(sl.errors.SigningError, match="nowhere: signatures cannot be read"):
        checked(log, key, elsewhere=[tmp_path / "nowhere"])


def test_hostile_folders(log: Path, key: SigningKey, tmp_path: Path) -> None:
    """Links, pipes and folders where statements should be: they are named, and nothing waits."""
    import os

    sign(log, key)
    folder = log / "signatures"
    os.mkfifo(folder / "1.head")
    (folder / "2.head").symlink_to("/etc/passwd")
    (folder / "3.head").mkdir()
    (folder / "4.head").write_bytes(b"x" * 10**6)
    (folder / "note.txt").write_text("not ours")

    assert (4, ["statement"] * 4) == checked(log, key)[:2]

    shutil.rmtree(folder)
    (tmp_path / "away").mkdir()
    folder.symlink_to(tmp_path / "away")
    with pytest.raises(sl.errors.SigningError, match="expected a folder of this log, got a link"):
        sign(log, key)
    assert [] == list((tmp_path / "away").iterdir())


def test_other_readers_do_not_mind(log: Path, key: SigningKey) -> None:
    """Nothing that asks a log, or verifies it without keys, sees the signatures."""
    before = (answers(log), verify(log))

    sign(log, key)

    after = (answers(log), verify(log))
    assert before == after
    from rosbags.highlevel import AnyReader

    with AnyReader([log]) as reader:
        assert reader.message_count


def test_a_log_of_nothing(tmp_path: Path, key: SigningKey) -> None:
    """There is nothing to vouch for, and nothing that lacks it."""
    with sl.create(tmp_path / "log", tz="UTC"):
        pass

    assert [] == sign(tmp_path / "log", key).made
    assert is_good(tmp_path / "log", key)
    assert [] == list(believed())
