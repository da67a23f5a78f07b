"""The oracle: it knows the log's form by itself, agrees with whole logs, and sees damage."""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from fault_injection.examined import Examined
from fault_injection.judging import commit_places
from fault_injection.oracle_client import PROGRAM, Oracle
from fault_injection.sample import Sample, make_chains


@pytest.fixture(scope="module")
def oracle() -> Iterator[Oracle]:
    with Oracle() as oracle:
        yield oracle


def test_it_shares_no_code_with_the_log(sample: Sample) -> None:
    """Nothing of ours, and no library that ours uses for its records, is imported."""
    code = """
import runpy, sys
program, log = sys.argv[1:]
sys.path.insert(0, program)
sys.argv = [program, log]
try:
    runpy.run_path(program, run_name="__main__")
except SystemExit:
    pass
foreign = {"semmap_log", "mcap", "rosbags", "numpy"} & {name.split(".")[0] for name in sys.modules}
print("foreign:", *sorted(foreign))
"""

    done = subprocess.run(
        [sys.executable, "-c", code, PROGRAM, sample.closed],
        capture_output=True, text=True, check=True,
    )  # fmt: skip

    assert '"problems": []' in done.stdout
    assert "foreign:" == done.stdout.splitlines()[-1].strip()


@pytest.mark.slow
def test_it_agrees_with_every_verb_on_whole_logs(tmp_path: Path, oracle: Oracle) -> None:
    """Closed, live, compacted, and the office recording; `Examined` compares and fails if not."""
    for chain in make_chains(tmp_path / "chains"):
        examined = Examined(chain.log, tmp_path / chain.title, oracle)

        assert 15 <= examined.commits
        assert 20 < sum(name.startswith("replay") for name in examined.truth)


@pytest.mark.slow
def test_it_sees_every_flipped_byte_of_a_commit(
    sample: Sample, tmp_path: Path, oracle: Oracle
) -> None:
    """In a closed segment, and in a live one, where the last commit may be taken for torn."""
    dice = random.Random(3)
    for log, name in ((sample.closed, "log_000001.mcap"), (sample.live, "log_000002.mcap")):
        copy = tmp_path / name / log.name
        shutil.copytree(log, copy)
        whole = (copy / name).read_bytes()
        for _, end in commit_places(copy / name):
            data = bytearray(whole)
            data[end - dice.randint(1, 100)] ^= 1 << dice.randrange(8)
            (copy / name).write_bytes(data)

            found = oracle.ask(copy)

            is_torn = any(segment["torn_at"] for segment in found["segments"])
            assert found["problems"] or is_torn


@pytest.mark.slow
def test_it_survives_any_head(sample: Sample, tmp_path: Path, oracle: Oracle) -> None:
    """A run of zeros anywhere before the first commit is told; the oracle goes on."""
    log = tmp_path / "log"
    shutil.copytree(sample.closed, log)
    whole = (log / "log_000000.mcap").read_bytes()
    for at in range(0, 600, 3):
        data = bytearray(whole)
        data[at : at + 16] = bytes(16)
        (log / "log_000000.mcap").write_bytes(data)

        assert oracle.ask(log)["problems"], at


def test_it_sees_a_missing_segment(sample: Sample, tmp_path: Path, oracle: Oracle) -> None:
    """By the numbers of the segments."""
    log = tmp_path / "log"
    shutil.copytree(sample.closed, log)
    (log / "log_000001.mcap").unlink()

    assert any("expected 1" in problem for problem in oracle.ask(log)["problems"])
