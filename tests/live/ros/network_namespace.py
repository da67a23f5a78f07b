"""A network of its own, with nothing but the loopback device: no other robot, no other test run.

A small process holds the namespace open. When the tests end, however they do, its standard input
ends; then it kills all that still runs in that network, and itself.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

UNSHARE = (["unshare", "-n"], ["unshare", "-rn"])
"""As root; as anybody, where the kernel lets everybody make user namespaces."""

SIOCGIFFLAGS = 0x8913
SIOCSIFFLAGS = 0x8914
IFF_UP = 0x1
"""From linux/sockios.h and linux/if.h."""


class NoNamespaceError(Exception):
    """This machine lets us make none."""


@dataclass(frozen=True, slots=True)
class NetworkNamespace:
    """A network that processes can be started in."""

    holder: subprocess.Popen[bytes]
    of_a_user: bool
    """Made without being root: whoever enters must enter the user namespace, too."""

    @classmethod
    def open(cls) -> NetworkNamespace:
        """Make one.

        Raises:
            NoNamespaceError: It is not allowed here.
        """
        for unshare in UNSHARE:
            holder = subprocess.Popen(
                [*unshare, sys.executable, __file__],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            assert holder.stdout is not None
            if holder.stdout.readline() == b"ready\n":
                return cls(holder, of_a_user=unshare != UNSHARE[0])
            holder.wait()
        raise NoNamespaceError("neither root nor user namespaces: `unshare -rn true` fails here")

    def inside(self, command: Sequence[str]) -> list[str]:
        """Return the command that starts another one inside; it is replaced by that one."""
        user = ["-U", "--preserve-credentials"] if self.of_a_user else []
        return ["nsenter", "-t", str(self.holder.pid), *user, "-n", *command]

    def close(self) -> None:
        """Kill all that runs inside."""
        assert self.holder.stdin is not None
        self.holder.stdin.close()
        self.holder.wait(timeout=100)


def main() -> None:
    """Hold the namespace that this process is in, until standard input ends."""
    for number in (signal.SIGINT, signal.SIGTERM):  # Ctrl-C is for the tests, which then let us go
        signal.signal(number, signal.SIG_IGN)
    _bring_up_loopback()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdin.buffer.read()
    _kill_all_inside()


def _kill_all_inside() -> None:
    """Kill until nobody is left: some start others meanwhile."""
    ours = Path("/proc/self/ns/net").readlink()
    is_alone = False
    while not is_alone:
        is_alone = True
        for process in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):  # ended, or somebody else's
                if process.name != str(os.getpid()) and (process / "ns" / "net").readlink() == ours:
                    is_alone = False
                    os.kill(int(process.name), signal.SIGKILL)


def _bring_up_loopback() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = struct.pack("16sH14x", b"lo", 0)
        answer = fcntl.ioctl(any_socket, SIOCGIFFLAGS, request)
        (flags,) = struct.unpack_from("H", answer, 16)
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sH14x", b"lo", flags | IFF_UP))


if __name__ == "__main__":
    main()
