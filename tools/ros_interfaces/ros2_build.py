"""ROS 2 messages compiled and installed into the venv that runs this, with gcc and g++ alone.

rclpy needs compiled type supports; there is no pure Python way. All of a package's code goes into
one library, which also bears the names under which ROS looks for its parts at run time.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from ros_interfaces.package import InterfacePackage
from ros_interfaces.ros2_sources import (
    GENERATORS,
    PYTHON,
    TYPE_DESCRIPTION,
    TYPESUPPORT,
    WIRE_TYPESUPPORTS,
    C,
    Sources,
    generate_sources,
)

PARTS = (C, TYPESUPPORT, *WIRE_TYPESUPPORTS, PYTHON)
"""The libraries of a package that CMake built; ours has one, by all these names."""
RUNTIME = ("rosidl_runtime_c", "rosidl_typesupport_c", "rosidl_typesupport_fastrtps_cpp",
           *WIRE_TYPESUPPORTS, "fastcdr", "rmw", "rcutils")  # fmt: skip


@dataclass(frozen=True, slots=True)
class Prefix:
    """Where ROS 2's wheels have put things: a venv."""

    root: Path
    site_packages: Path

    @property
    def share(self) -> Path:
        return self.root / "share"

    @property
    def lib(self) -> Path:
        return self.root / "lib"

    @property
    def include(self) -> Path:
        return self.root / "include"


def build(package: InterfacePackage) -> None:
    """Build a package and install it, instead of what is installed under its name.

    Raises:
        SystemExit: A package it needs is not installed, or the compiler refuses something.
    """
    prefix = Prefix(Path(sys.prefix), Path(sysconfig.get_paths()["purelib"]))
    with tempfile.TemporaryDirectory(prefix="ros_messages_") as work:
        sources = generate_sources(package, share=prefix.share, work=Path(work))
        _write_together(sources)
        includes = _include_options(sources, prefix)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            objects = list(pool.map(lambda path: _compile(path, includes), _files_of(sources)))
        _link_library(sources, prefix, [path for path in objects if ".ep." not in path.name])
        _install_python(sources, prefix, next(path for path in objects if ".ep." in path.name))
        _install_shared(sources, prefix)


def _write_together(sources: Sources) -> None:
    """Have a generator's C++ files compiled as one: their time goes into headers they share."""
    for generator in GENERATORS:
        paths = sorted(sources.folder(generator).rglob("*.cpp"))
        if paths:
            lines = [f'#include "{path}"\n' for path in paths]
            (sources.work / f"{generator}.cpp").write_text("".join(lines), encoding="utf-8")


def _files_of(sources: Sources) -> list[Path]:
    """Return what is compiled, what takes longest first."""
    return [
        *sorted(sources.work.glob("*.cpp")),
        *(
            path
            for generator in GENERATORS
            for path in sorted(sources.folder(generator).rglob("*.c"))
        ),
    ]


def _include_options(sources: Sources, prefix: Prefix) -> list[str]:
    import numpy as np

    folders = [
        *(sources.work / generator for generator in GENERATORS),
        prefix.include,
        *(path for path in prefix.include.iterdir() if path.is_dir()),
        sysconfig.get_paths()["include"],
        np.get_include(),
    ]
    return [f"-I{folder}" for folder in folders]


def _compile(source: Path, includes: Sequence[str]) -> Path:
    compiler = ["g++", "-std=gnu++17"] if source.suffix == ".cpp" else ["gcc"]
    target = source.with_name(source.name + ".o")
    _run([*compiler, "-O1", "-fPIC", "-w", *includes, "-c", str(source), "-o", str(target)])
    return target


def _link_library(sources: Sources, prefix: Prefix, objects: Sequence[Path]) -> None:
    name = sources.package.name
    library = prefix.lib / f"lib{name}.so"
    needs = [f"-l{need}__{part}" for need in sources.needs for part in PARTS]
    _run(["g++", "-shared", "-o", str(library), *map(str, objects), f"-L{prefix.lib}",
          "-Wl,--no-as-needed", *needs, *(f"-l{name}" for name in RUNTIME),
          "-Wl,-rpath,$ORIGIN"])  # fmt: skip
    for part in PARTS:
        link = prefix.lib / f"lib{name}__{part}.so"
        link.unlink(missing_ok=True)
        link.symlink_to(library.name)


def _install_python(sources: Sources, prefix: Prefix, entry: Path) -> None:
    """Put the Python modules into the venv, with the extension module that they import."""
    name = sources.package.name
    target = prefix.site_packages / name
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(sources.folder(PYTHON), target, ignore=shutil.ignore_patterns("*.c", "*.o"))
    up = os.path.relpath(prefix.lib, target)
    _run(["gcc", "-shared", "-o", str(target / f"{name}_s__{TYPESUPPORT}.so"), str(entry),
          f"-L{prefix.lib}", f"-l{name}", "-Wl,--allow-shlib-undefined",
          f"-Wl,-rpath,$ORIGIN/{up}"])  # fmt: skip


def _install_shared(sources: Sources, prefix: Prefix) -> None:
    """Put definitions and headers where packages that are built on this one look for them."""
    name = sources.package.name
    share = prefix.share / name
    shutil.rmtree(share, ignore_errors=True)
    for folder in (sources.package.folder, sources.interfaces, sources.folder(TYPE_DESCRIPTION)):
        for path in [
            path
            for path in folder.glob("*/*")
            if path.suffix in {".msg", ".srv", ".action", ".idl", ".json"}
        ]:
            target = share / path.relative_to(folder)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    headers = prefix.include / name / name
    shutil.rmtree(headers.parent, ignore_errors=True)
    for generator in (C, *WIRE_TYPESUPPORTS):
        folder = sources.folder(generator)
        shutil.copytree(folder, headers, ignore=shutil.ignore_patterns("*.c", "*.cpp", "*.o"),
                        dirs_exist_ok=True)  # fmt: skip


def _run(command: Sequence[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}\n{done.stderr.strip()}")
