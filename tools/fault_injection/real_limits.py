"""What a machine itself refuses: a full disk, a file too large, no more files, no right to write.

Nothing is simulated here: a tmpfs of a few KiB, limits of the process, a read-only mount, another
user. When the log has failed the limit is lifted, and the same program goes on.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
from collections.abc import Callable, Generator
from contextlib import ExitStack, suppress
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path
from random import Random

import semmap_log as sl
from fault_injection.examiner import Examiner
from fault_injection.fault import CannotTryError, Outcome, Plan, Tree, keep, read_tree, write_tree
from fault_injection.forking import Ended, forked
from fault_injection.player import LEVELS, Player, StubbornPlayer, Tell
from fault_injection.story import small_limits, story
from semmap_log.errors import LogAccessError

EMPTY: Tree = {"out": {}}
USUAL_FAULTS = 100
NOBODY = 65534
LARGE = "size=64m"
KIB = 1024


def real_limits(plan: Plan) -> Generator[Outcome, None, None]:
    """Yield what became of the log at each limit; those that only root can set come in turn."""
    if os.geteuid() != 0 or shutil.which("mount") is None:
        raise CannotTryError("only root can mount a tmpfs and become another user")
    with small_limits(), ExitStack() as stack:
        bench = _Bench(plan, stack)
        kinds = cycle((bench.full_disk, bench.file_too_large, bench.no_more_files,
                       bench.full_disk, bench.read_only, bench.another_user))  # fmt: skip
        tries = (kind(level) for kind, level in zip(kinds, cycle(LEVELS), strict=False))
        yield from islice((found for found in tries if found is not None), plan.most(USUAL_FAULTS))


class _Bench:
    """A story on a small disk of its own."""

    def __init__(self, plan: Plan, stack: ExitStack) -> None:
        self._plan = plan
        self._story = story(plan.seed)
        self._examiner = Examiner(self._story)
        self._random = Random(plan.seed)
        self._root = plan.folder / "mounted"
        self._root.mkdir()
        self._root.chmod(0o755)
        plan.folder.chmod(0o755)
        _do("mount", "-t", "tmpfs", "-o", f"{LARGE},mode=755", "tmpfs", str(self._root))
        stack.callback(_do, "umount", "--lazy", str(self._root))
        self._log = self._root / "run" / "log"

    def full_disk(self, level: str) -> Outcome | None:
        """The disk is full after so many KiB: reading goes on; when there is room, so does all."""
        size = self._random.randrange(4, 250)

        def limit() -> None:
            _do("mount", "-o", f"remount,size={size}k", str(self._root))

        def lift() -> None:
            if list(self._log.glob("*.mcap")):
                list(sl.read(self._log).batches())
            _do("mount", "-o", f"remount,{LARGE}", str(self._root))

        return self._limited(f"({level}) a disk of {size} KiB", level, limit, lift)

    def file_too_large(self, level: str) -> Outcome | None:
        """No file may be larger than so many bytes: a write is cut, the next one refused."""
        most = self._random.randrange(10, 45 * KIB)
        name = f"({level}) files of {most} bytes at most"
        return self._limited(name, level, *_of_process(resource.RLIMIT_FSIZE, lambda: most))

    def no_more_files(self, level: str) -> Outcome | None:
        """So many more files may be opened, from the n-th commit on."""
        more = self._random.randrange(5)
        name = f"({level}) {more} more files"
        limit, lift = _of_process(resource.RLIMIT_NOFILE, lambda: _open_files() + more)
        return self._limited(name, level, limit, lift, from_wish=self._random.randrange(20))

    def read_only(self, level: str) -> Outcome:
        """On a read-only mount, with a torn tail: it is read, and nothing else."""
        return self._refused(
            f"({level}) a read-only disk",
            level,
            lambda: _do("mount", "-o", "remount,ro", str(self._root)),
            lambda: _do("mount", "-o", "remount,rw", str(self._root)),
        )

    def another_user(self, level: str) -> Outcome:
        """As nobody, in a folder of root's: it is read, and nothing else."""
        import zoneinfo  # noqa: F401 - nobody may not read a Python that lies at its owner's

        def become_nobody() -> None:
            os.setgid(NOBODY)
            os.setuid(NOBODY)

        return self._refused(f"({level}) another user", level, become_nobody, lambda: None)

    def _limited(
        self,
        name: str,
        level: str,
        limit: Callable[[], None],
        lift: Callable[[], None],
        *,
        from_wish: int = 0,
    ) -> Outcome | None:
        """Return what became of a log that met a limit, which was lifted at the first failure.

        None: it did not meet it.
        """

        def play(tell: Tell) -> None:
            waited_for = f"asked {from_wish}"

            def tell_and_limit(line: str) -> None:
                nonlocal waited_for
                if line == waited_for:
                    waited_for = ""  # once: when it is asked again, the limit was lifted
                    limit()
                tell(line)

            if from_wish == 0:
                limit()
            StubbornPlayer(self._log, self._story, tell_and_limit, level, lift).play()

        write_tree(self._log.parent, EMPTY)
        ended = forked(play)
        _do("mount", "-o", f"remount,{LARGE}", str(self._root))
        if not ended.error and not any(line.startswith("failure") for line in ended.lines):
            return None
        wrong = [line for line in ended.lines if line.startswith("broken")]
        if "finished" not in ended.lines:
            wrong.append("the run did not go on when the limit was lifted")
        return self._outcome(name, level, ended, "; ".join(wrong))

    def _refused(
        self, name: str, level: str, in_child: Callable[[], None], after: Callable[[], None]
    ) -> Outcome:
        """Return what became of a log with a torn tail that can be read and not written."""
        write_tree(self._log.parent, EMPTY)
        ended = forked(lambda tell: Player(self._log, self._story, tell, level).play())
        last = max(self._log.glob("*.mcap"))
        last.write_bytes(last.read_bytes()[:-20] + self._random.randbytes(10))
        left = read_tree(self._root)

        def look(tell: Tell) -> None:
            in_child()
            tell(f"read {len(list(sl.read(self._log).commits()))}")
            with suppress(LogAccessError):
                sl.append(self._log)
                tell("it was opened for writing")
            with suppress(LogAccessError):
                sl.create(self._root / "new")
                tell("another was made")

        looked = forked(look)
        after()
        wrong = list(looked.lines) + [looked.error] * bool(looked.error)
        if f"read {ended.told.accepted}" in wrong:
            wrong.remove(f"read {ended.told.accepted}")
        if read_tree(self._root) != left:
            wrong.append("something was written")
        return self._outcome(name, level, ended, "; ".join(wrong))

    def _outcome(self, name: str, level: str, ended: Ended, wrong: str) -> Outcome:
        fault = f"story {self._plan.seed} {name}"
        left = read_tree(self._log.parent)
        if ended.error or wrong:
            outcome = Outcome(fault, problem=ended.error or wrong)
        else:
            must = ended.told.durable if level == "none" else ended.told.accepted
            # In a copy: a file that is mapped here would keep the small disk busy.
            copy = self._plan.folder / "examined"
            write_tree(copy, left)
            outcome = self._examiner.examine(fault, copy / "log", ended.told, must=must)
        if outcome.is_good:
            return outcome
        return replace(outcome, kept=keep(self._plan.keep, fault, left))


def _of_process(
    which: int, most: Callable[[], int]
) -> tuple[Callable[[], None], Callable[[], None]]:
    """Return what sets a limit of the process, and what lifts it again."""
    usual, hard = resource.getrlimit(which)
    return (
        lambda: resource.setrlimit(which, (most(), hard)),
        lambda: resource.setrlimit(which, (usual, hard)),
    )


def _open_files() -> int:
    """Return one more than the highest file descriptor in use."""
    return max(int(path.name) for path in Path("/proc/self/fd").iterdir())


def _do(*command: str) -> None:
    """Run a command.

    Raises:
        CannotTryError: It failed; what it said.
    """
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise CannotTryError(f"{' '.join(command)}: {done.stderr.strip()}")
