"""What all tests share: the real data beside the checkout, clocks and randomness that repeat."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
from collections.abc import Callable
from functools import partial
from pathlib import Path
from shutil import which

import pytest
from steady_clock import SteadyClock

from tests import quick
from tests.golden_text import GoldenText
from tests.verbs import Refuses, Verb, check_refusals, ran

MEMORY = Path("/dev/shm")
ROOM_BYTES = 2**30
"""Enough for two test runs at a time."""

if MEMORY.is_dir() and shutil.disk_usage(MEMORY).free > ROOM_BYTES:
    # Thousands of small logs are made, synced and broken. What a disk keeps of them at a power cut
    # is the business of tests/faults, which have disks of their own.
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(MEMORY))

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # As in a shell's background job, which would hand it on to all that the tests interrupt.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(pluginmanager: pytest.PytestPluginManager) -> None:
    """Load what chooses the tests, once: experiments have a conftest of their own."""
    if not pluginmanager.has_plugin("quick"):
        pluginmanager.register(quick, "quick")


SHARED = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real door logs and maps; absent in a bare clone."""
    if not SHARED.is_dir():
        pytest.skip("the real data (../shared/data) is not beside this checkout")
    return SHARED


@pytest.fixture
def golden(request: pytest.FixtureRequest, tmp_path: Path) -> GoldenText:
    """Check texts against the golden file of a verb: `golden(verb, case, text)`."""
    return GoldenText(tmp_path, is_rewritten=request.config.option.golden)


@pytest.fixture
def run_verb(capsys: pytest.CaptureFixture[str]) -> Verb:
    """Run a verb of the command line; return its exit code, stdout and stderr."""
    return partial(ran, capsys)


@pytest.fixture
def refuses(run_verb: Verb, golden: GoldenText) -> Refuses:
    """Check that command lines fail as golden files have it: `refuses(lines)`."""
    return partial(check_refusals, run_verb, golden)


@pytest.fixture
def clock() -> SteadyClock:
    return SteadyClock()


@pytest.fixture
def patient_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let poses wait for a commit to join, however slow this machine is: not only a second."""
    monkeypatch.setattr("semmap_log.log.door_log.appender.POSES_WAIT_S", 100)


@pytest.fixture
def entropy() -> Callable[[int], bytes]:
    """Like os.urandom, the same at each run."""
    return random.Random(7).randbytes


@pytest.fixture(scope="session")
def node_packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the node packages; skips, saying why, where they cannot be had."""
    if which("node") is None or which("npm") is None:
        pytest.skip("Node.js is not installed")
    folder = tmp_path_factory.mktemp("node")
    packages = [
        "@mcap/core@2",
        "@mcap/support@1",
        "@mcap/nodejs@1",
        "@foxglove/rosmsg@5",
        "@foxglove/rosmsg2-serialization@3",
    ]
    try:
        done = subprocess.run(
            ["npm", "install", "--no-audit", "--no-fund", "--silent", *packages],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            timeout=240,
        )
    except subprocess.TimeoutExpired:
        pytest.skip("npm does not get @mcap/core here within 4 minutes")
    if done.returncode:
        pytest.skip(f"npm cannot install @mcap/core here: {done.stderr.strip()[:200]}")
    return folder


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let tables be drawn, 80 columns wide and without colours, as people see them."""
    monkeypatch.setattr("semmap_log.cli.sanitized_streams.is_for_people", lambda: True)
    monkeypatch.setenv("COLUMNS", "80")
