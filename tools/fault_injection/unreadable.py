"""Sectors that cannot be read, and files that get shorter while they are read: never a signal."""

from __future__ import annotations

import fcntl
import os
import random
import struct
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

from fault_injection.examined import Examined, Findings
from fault_injection.fault import Outcome, Plan
from fault_injection.judging import keep
from fault_injection.loop_device import LoopDevice, mounted
from fault_injection.oracle_client import Oracle
from fault_injection.pool import side_by_side
from fault_injection.sample import Chain, make_chains

USUAL = 60
IMAGE_MIB = 16
BLOCK = 4096
MAKE = ("mkfs.ext4", "-q", "-F", "-b", str(BLOCK), "-O", "^has_journal", "-m", "0", "-e",
        "continue")  # fmt: skip
_FIBMAP = 1
PAGE = os.sysconf("SC_PAGE_SIZE")


def unreadable_sectors(plan: Plan) -> Generator[Outcome, None, None]:
    """Let blocks of a file system fail to be read, as those of a dying SD card do."""
    yield from side_by_side(_share_of_disk, plan)


def shrinking_files(plan: Plan) -> Generator[Outcome, None, None]:
    """Shorten files in place, as `cp` does with a mirror, under readers and verbs."""
    yield from side_by_side(_share_of_shrinking, plan)


def _share_of_shrinking(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    folder = plan.folder / f"shrinking-{share}"
    with Oracle() as oracle:
        chains = make_chains(folder / "chains")
        logs: dict[str, Examined] = {}
        for turn in plan.turns(USUAL, share, shares):
            dice = random.Random(f"{plan.seed} {turn}")
            chain = dice.choice(chains)
            if chain.title not in logs:
                logs[chain.title] = Examined(chain.log, folder / chain.title, oracle)
            log = logs[chain.title]
            name = dice.choice(_closed_segments(chain))
            size = _shorter(dice, (log.whole / name).stat().st_size)
            flaps = dice.random() < 0.5
            damage = partial(_flap if flaps else _shorten, name=name, size=size)
            what = f"{'again and again ' if flaps else ''}shortened to {size} bytes"
            findings = log.try_damage(damage, turn, writer="")
            yield _outcome(plan, f"{turn}: {chain.title} log, {name} {what}", log, findings)


def _closed_segments(chain: Chain) -> list[str]:
    names = sorted(path.name for path in chain.log.glob("*.mcap"))
    return names[:-1] if chain.is_live else names


def _shorter(dice: random.Random, size: int) -> int:
    """Draw a length: often such that whole pages are gone."""
    pages = dice.randrange(size // PAGE + 1) * PAGE
    return dice.choice((0, pages, pages, dice.randrange(size), size - 1))


def _shorten(log: Path, *, name: str, size: int) -> None:
    os.truncate(log / name, size)


def _flap(log: Path, *, name: str, size: int) -> None:
    """Shorten a file and make it whole again, over and over, until the process ends."""
    data = (log / name).read_bytes()

    def work() -> None:
        dice = random.Random(size)
        while True:
            with suppress(OSError):
                os.truncate(log / name, size)
                time.sleep(dice.random() * 0.004)
                with (log / name).open("r+b") as file:
                    file.write(data)
            time.sleep(dice.random() * 0.004)

    threading.Thread(target=work, daemon=True).start()


def _outcome(plan: Plan, what: str, log: Examined, findings: Findings) -> Outcome:
    if not (findings.problems or findings.lost):
        return Outcome(what, log.commits)
    kept = keep(log.whole, plan.keep, what)
    return Outcome(what, log.commits, findings.lost, 0, "\n".join(findings.problems), kept)


def _share_of_disk(plan: Plan, share: int, shares: int) -> Iterator[Outcome]:
    folder = plan.folder / f"disk-{share}"
    folder.mkdir()
    with Oracle() as oracle, mounted(folder, MAKE, IMAGE_MIB) as device:
        disk = _Disk(device)
        chains = make_chains(folder / "chains")
        logs: dict[str, Examined] = {}
        for turn in plan.turns(USUAL, share, shares):
            dice = random.Random(f"{plan.seed} {turn}")
            chain = dice.choice(chains)
            disk.make_anew()
            if chain.title not in logs:
                logs[chain.title] = Examined(
                    chain.log, folder / chain.title, oracle, damaged=disk.folder
                )
            log = logs[chain.title]
            name = dice.choice(_closed_segments(chain))
            block = dice.randrange(((log.whole / name).stat().st_size - 1) // BLOCK + 1)
            damage = partial(disk.fail_from, name=name, block=block)
            findings = log.try_damage(damage, turn, place=disk, writer=dice.choice(("recover", "")))
            what = f"{turn}: {chain.title} log, nothing readable from block {block} of {name} on"
            yield _outcome(plan, what, log, findings)


class _Disk:
    """A small ext4 whose image can be cut: what lay behind the cut can then not be read."""

    def __init__(self, device: LoopDevice) -> None:
        self._device = device
        self.folder = device.folder
        self.make_anew = device.make_anew

    def settle(self, log: Path) -> None:
        """Have all bytes on the disk, and none in memory."""
        os.sync()
        for path in log.iterdir():
            fd = os.open(path, os.O_RDONLY)
            os.posix_fadvise(fd, 0, 0, os.POSIX_FADV_DONTNEED)
            os.close(fd)

    def fail_from(self, log: Path, *, name: str, block: int) -> None:
        """Let a block of a file, and all blocks that lie behind it, fail to be read."""
        at = _place_on_disk(log / name, block)
        if not at:
            raise RuntimeError(f"block {block} of {name} lies nowhere")
        os.truncate(self._device.image, at * BLOCK)
        self.settle(log)


def _place_on_disk(path: Path, block: int) -> int:
    fd = os.open(path, os.O_RDONLY)
    try:
        answer = fcntl.ioctl(fd, _FIBMAP, struct.pack("I", block))
    finally:
        os.close(fd)
    return int(struct.unpack("I", answer)[0])
