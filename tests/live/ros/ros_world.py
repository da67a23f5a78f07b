"""A real ROS with a network of its own: tests start our verbs, clients and ROS's tools in it.

    def test_something(ros1: RosWorld, tmp_path: Path) -> None:
        with ros1.semmap("serve", log, ros1.option) as server:
            server.wait_for("...")
            assert "..." in ros1.code(CLIENT, "/topic").finish()

A world lives as long as the tests of a worker; what a test starts it stops, by `with`.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from shutil import rmtree, which
from typing import Any

from tests.live.ros.network_namespace import NetworkNamespace
from tests.live.ros.running import DEADLINE_S, Running, T, wait_until

ROOT = Path(__file__).parents[3]
NAMES = {"ros1": "ROS 1", "jazzy": "ROS 2 Jazzy", "kilted": "ROS 2 Kilted"}
MASTER_PORT = 11311

_NOT_INHERITED = (
    "ROS_", "RMW_", "AMENT_", "COLCON_", "CMAKE_", "FASTDDS_", "FASTRTPS_", "CYCLONEDDS_",
    "_ROS_WHEELS", "LD_LIBRARY_PATH", "PYTHON", "COVERAGE_",
)  # fmt: skip
"""Neither a robot's settings nor those that another Python was started with."""


class NotSetUpError(Exception):
    """This ROS cannot be had here, and why."""


def interpreter(leg: str) -> Path:
    """Return the Python of a ROS, as tools/set_up_ros.py makes it.

    Args:
        leg: `ros1`, `jazzy` or `kilted`.

    Raises:
        NotSetUpError: It is not set up here.
    """
    folder = Path(os.environ.get("SEMMAP_ROS", ROOT / ".ros"))
    python = folder / leg / "bin" / "python"
    if not python.exists():
        raise NotSetUpError(f"{NAMES[leg]} is not set up here: python tools/set_up_ros.py {leg}")
    return python


@dataclass(slots=True)
class RosWorld:
    """One ROS in one network."""

    leg: str
    """`ros1`, `jazzy` or `kilted`."""
    interpreter: Path
    network: NetworkNamespace
    folder: Path
    """For what its processes write: outputs, ROS's own logs."""
    started: list[Running] = field(default_factory=list)
    _master: Running | None = None

    @property
    def version(self) -> int:
        """Return 1 or 2."""
        return 1 if self.leg == "ros1" else 2

    @property
    def option(self) -> str:
        """Return what our verbs take: `--ros1` or `--ros2`."""
        return f"--ros{self.version}"

    @property
    def environment(self) -> dict[str, str]:
        """Return the variables of all its processes."""
        base = {name: value for name, value in os.environ.items()
                if not name.startswith(_NOT_INHERITED)}  # fmt: skip
        ours = {
            "PYTHONPATH": str(ROOT),
            "PYTHONUNBUFFERED": "1",
            "ROS_HOME": str(self.folder / "home"),
        }
        return base | ours | (_ROS1 if self.version == 1 else _ROS2)

    def semmap(self, verb: str, *arguments: object, **how: Any) -> Running:
        """Start one of our verbs; `how` as for `run`."""
        return self.python("-m", "semmap_log", verb, *arguments, **how)

    def code(self, text: str, *arguments: object, **how: Any) -> Running:
        """Start a program given as its text."""
        path = self._new_folder() / "client.py"
        path.write_text(text, encoding="utf-8")
        return self.python(path, *arguments, **how)

    def tool(self, name: str, *arguments: object, **how: Any) -> Running:
        """Start a tool of ROS that is written in Python, such as `rostopic`, as this world's."""
        path = which(name)
        assert path is not None, f"{name} is not installed"
        return self.python(path, *arguments, **how)

    def python(self, *arguments: object, **how: Any) -> Running:
        """Start the interpreter of this ROS."""
        return self.run(self.interpreter, *arguments, **how)

    def run(
        self, *command: object, environment: Mapping[str, str] | None = None,
        cwd: Path | None = None, under: Mapping[int, int] | None = None,
    ) -> Running:  # fmt: skip
        """Start a program inside.

        Args:
            command: Its name and arguments.
            environment: Variables beside the world's.
            cwd: Where; default: the folder that has its output.
            under: Resource limits, such as `{resource.RLIMIT_FSIZE: 4096}`.
        """
        words = [str(word) for word in command]
        folder = self._new_folder()
        with (folder / "stdout").open("wb") as out, (folder / "stderr").open("wb") as err:
            process = subprocess.Popen(
                self.network.inside([*_limits(under or {}), *words]),
                stdin=subprocess.PIPE, stdout=out, stderr=err,
                cwd=cwd or folder, env=self.environment | dict(environment or {}),
            )  # fmt: skip
        running = Running(process, " ".join(words[-8:]), folder)
        self.started.append(running)
        return running

    def wait_until(
        self, condition: Callable[[], T | None], what: str | Callable[[], str], *,
        timeout_s: float = DEADLINE_S,
    ) -> T:  # fmt: skip
        """Return what `condition` returns as soon as that is true."""
        return wait_until(condition, what, timeout_s=timeout_s)

    def stop(self, running: Running) -> int:
        """Ask a process to end, as Ctrl-C does; return its exit code."""
        return running.stop()

    def start_master(self) -> None:
        """Start ROS 1's master, and wait until it answers."""
        self._master = self.tool("rosmaster", "--core", "-p", MASTER_PORT)
        self.code(_MASTER_ANSWERS, DEADLINE_S).finish()
        assert not self._master.is_over, str(self._master)

    def stop_master(self) -> None:
        """Kill ROS 1's master; nodes stay."""
        assert self._master is not None
        self._master.kill()

    def close(self) -> None:
        """Kill all that still runs."""
        self.network.close()
        for running in self.started:
            running.process.wait(timeout=DEADLINE_S)
            if running.process.stdin is not None:
                running.process.stdin.close()
        rmtree(self.folder, ignore_errors=True)

    def _new_folder(self) -> Path:
        return Path(tempfile.mkdtemp(dir=self.folder))


def open_world(leg: str) -> RosWorld:
    """Make a world, with a master where its ROS has one.

    Raises:
        NotSetUpError: That ROS is not set up here.
        NoNamespaceError: Networks of one's own are not allowed here.
    """
    python = interpreter(leg)
    network = NetworkNamespace.open()
    world = RosWorld(leg, python, network, Path(tempfile.mkdtemp(prefix=f"semmap_{leg}_")))
    try:
        if world.version == 1:
            world.start_master()
    except BaseException:
        world.close()
        raise
    return world


_ROS1 = {
    "ROS_VERSION": "1",
    "ROS_MASTER_URI": f"http://127.0.0.1:{MASTER_PORT}",
    "ROS_IP": "127.0.0.1",
}
_ROS2 = {
    "ROS_VERSION": "2",
    "ROS_DOMAIN_ID": str(os.getpid() % 100 + 1),
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    # Shared memory reaches over networks, and what a killed process held stays held.
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
}

_MASTER_ANSWERS = """
import sys, time
import rosgraph
end = time.monotonic() + float(sys.argv[1])
while not rosgraph.is_master_online():
    assert time.monotonic() < end, "no master answers"
    time.sleep(0.02)
"""


def _limits(limits: Mapping[int, int]) -> list[str]:
    """Return the beginning of a command that runs under resource limits."""
    options = [f"--{_PRLIMIT[which]}={limit}" for which, limit in limits.items()]
    return ["prlimit", *options] if options else []


def _names_of_limits() -> dict[int, str]:
    import resource

    return {resource.RLIMIT_FSIZE: "fsize", resource.RLIMIT_NOFILE: "nofile",
            resource.RLIMIT_AS: "as"}  # fmt: skip


_PRLIMIT = _names_of_limits()
