"""Show that the tests go every way through the code that a log's safety rests on.

    python tools/branch_coverage.py                 run the tests that matter, then the table
    python tools/branch_coverage.py -k torn         the same with arguments for pytest
    python tools/branch_coverage.py tests/core/messages  only these tests

The exit code is 1 if a line or a branch of one of these files was never taken. Child processes
are counted, too (`patch = subprocess` of coverage 7.10).
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MEASURED = (
    "semmap_log/store/writing/writer.py",
    "semmap_log/store/writing/durability.py",
    "semmap_log/store/writing/segment_chain.py",
    "semmap_log/store/segment.py",
    "semmap_log/store/commit_records.py",
    "semmap_log/store/chunk_builder.py",
    "semmap_log/store/record_runs.py",
    "semmap_log/store/writing/segment_chain.py",
    "semmap_log/store/writing/writer_opening.py",
    "semmap_log/store/writing/writer.py",
    "semmap_log/store/lock.py",
    "semmap_log/core/io/disk.py",
    "semmap_log/core/messages/layout.py",
)
TESTS = (
    "tests/store/writing",
    "tests/store/test_whole_files.py",
    "tests/store/test_folder.py",
    "tests/store/test_closing.py",
    "tests/store/test_elsewhere.py",
    "tests/core/io/test_disk.py",
    "tests/store/test_guards.py",
    "tests/core/messages",
    "tests/test_command_content.py",
    "tests/test_appending_batches.py",
    "tests/interop/exporting/test_lines_round_trip.py",
    "tests/interop/exporting/test_log_files.py",
)
"""Enough for all of them, in a minute; others take the same ways, and longer."""
SETTINGS = """
[run]
branch = true
parallel = true
sigterm = true
patch = subprocess
data_file = {folder}/data
include =
    {include}
[report]
show_missing = true
skip_covered = false
exclude_also =
    if TYPE_CHECKING:
    assert_never
    if os.name == .nt.:
    ^\\s*\\.\\.\\.$
"""


def main(arguments: list[str]) -> int:
    """Run the tests under coverage and print the table; 0 if everything was taken."""
    memory = Path("/dev/shm")  # noqa: S108 - a folder of our own is made in it
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        Path(folder).chmod(0o755)  # some tests become nobody, and look in
        settings = Path(folder) / "settings"
        include = "\n    ".join(str(ROOT / path) for path in MEASURED)
        settings.write_text(SETTINGS.format(folder=folder, include=include), encoding="utf-8")
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": folder}
        coverage = [sys.executable, "-m", "coverage"]
        rcfile = f"--rcfile={settings}"
        run = [*coverage, "run", rcfile, "-m", "pytest", "--all", "-q",
               "-p", "no:cacheprovider"]  # fmt: skip
        tests = [] if any(a.startswith("tests/") for a in arguments) else [*TESTS]
        done = subprocess.run([*run, *tests, *arguments], cwd=ROOT, env=environment, check=False)
        subprocess.run([*coverage, "combine", "-q", rcfile], cwd=ROOT, env=environment, check=False)
        report = [*coverage, "report", rcfile, "--fail-under=100"]
        shown = subprocess.run(report, cwd=ROOT, env=environment, check=False)
    return int(bool(done.returncode or shown.returncode))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
