"""Builds the compiled loops when semmap-log is installed, where that can be done.

Hatchling calls this for each wheel, and for an editable install, whose loops lie beside their
source. Without a C compiler, Python's headers or Cython, or with `SEMMAP_LOG_PLAIN=1`, the
installation goes on without them. One line of the build's output says what was done (`pip -v`).
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ImportError:  # not needed for `build` alone
    BuildHookInterface = object

PACKAGE = "semmap_log/core/loops"
NAME = "native"
PLAIN = "SEMMAP_LOG_PLAIN"
CYTHON = "cython>=3.1,<4"
MOST_SECONDS = 120
"""For the compiler: it takes about five."""
_SUFFIX = sysconfig.get_config_var("EXT_SUFFIX")
_MODULE = f"{PACKAGE}/{NAME}{_SUFFIX}"

_SHARED = ["-bundle", "-undefined", "dynamic_lookup"] if sys.platform == "darwin" else ["-shared"]
_OPTIONS = ["-O2", "-DNDEBUG", "-fPIC", "-fvisibility=hidden", *_SHARED]

_TRY = """
import sys
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location(sys.argv[1], sys.argv[2])
made = module_from_spec(spec)
spec.loader.exec_module(made)
assert made.INTERFACE > 0
"""


class NotBuilt(Exception):  # noqa: N818  # no error: the installation goes on
    """There will be no loops; the text says why."""


class BuildLoops(BuildHookInterface):
    """The hook: what is built is added to the wheel, or laid beside its source."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Return what has to be there for building: nothing, where nothing can be built."""
        return [] if why_not() else [CYTHON]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build, and take note of what was built."""
        self._folder = tempfile.mkdtemp(prefix="semmap-log-loops-")
        beside = Path(self.root, _MODULE)
        try:
            made = build(Path(self.root, PACKAGE, f"{NAME}.pyx"), Path(self._folder))
        except NotBuilt as reason:
            beside.unlink(missing_ok=True)  # an older one
            self.app.display_warning(f"semmap-log goes without compiled loops: {reason}")
            return
        if version == "editable":
            shutil.copy2(made, beside.with_suffix(".new"))
            beside.with_suffix(".new").replace(beside)
        else:
            build_data["force_include"][str(made)] = _MODULE
            build_data["pure_python"] = False
            build_data["infer_tag"] = True
        self.app.display_info(f"semmap-log has compiled loops: {_MODULE}")

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove what is packed by now."""
        shutil.rmtree(self._folder, ignore_errors=True)


def why_not() -> str:
    """Return why no loops can be built, as far as that is known before; empty if they can."""
    if os.environ.get(PLAIN, "0") not in {"", "0"}:
        return f"{PLAIN} asks for it"
    if _compiler() is None:
        return "there is no C compiler (cc)"
    if not Path(sysconfig.get_path("include"), "Python.h").exists():
        return "Python's headers (Python.h) are missing"
    return ""


def build(source: Path, folder: Path) -> Path:
    """Return the module built from a source, in that folder.

    Raises:
        NotBuilt: It could not be built, or cannot be loaded.
    """
    if reason := why_not():
        raise NotBuilt(reason)
    if not source.exists():
        raise NotBuilt(f"{source} is missing")
    c_file, made = folder / f"{NAME}.c", folder / f"{NAME}{_SUFFIX}"
    to_c = [sys.executable, "-m", "cython", "-3", str(source), "-o", str(c_file)]
    compiler, include = _compiler(), sysconfig.get_path("include")
    assert compiler is not None, "asked above"
    to_module = [*compiler, *_OPTIONS, f"-I{include}", str(c_file), "-o", str(made)]
    for command in (to_c, to_module, [sys.executable, "-c", _TRY, NAME, str(made)]):
        _run(command)
    return made


def _run(command: list[str]) -> None:
    try:
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=MOST_SECONDS)
    except subprocess.CalledProcessError as error:
        told = (error.stderr or error.stdout).strip().splitlines() or [f"code {error.returncode}"]
        raise NotBuilt(f"{Path(command[0]).name} failed: {told[-1]}") from None
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NotBuilt(f"{Path(command[0]).name}: {error}") from None


def _compiler() -> list[str] | None:
    """Return the words that call the C compiler: CC, Python's own, or the system's."""
    if sys.platform == "win32":
        return None
    for words in (os.environ.get("CC"), sysconfig.get_config_var("CC"), "cc", "gcc", "clang"):
        command = (words or "").split()
        if command and shutil.which(command[0]):
            return command
    return None
