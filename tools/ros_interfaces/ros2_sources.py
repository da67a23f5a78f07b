"""The C, C++ and Python sources of a ROS 2 package's messages, by rosidl's own generators.

What `rosidl_generate_interfaces` has CMake do: definitions become .idl, those get type hashes, and
each generator reads a JSON file of arguments. Runs in a venv with ROS 2's wheels.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ros_interfaces.package import InterfacePackage

C = "rosidl_generator_c"
TYPE_DESCRIPTION = "rosidl_generator_type_description"
PYTHON = "rosidl_generator_py"
TYPESUPPORT = "rosidl_typesupport_c"
WIRE_TYPESUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""rmw_fastrtps_cpp asks for the second first; without it, each type logs long errors."""
GENERATORS = (C, *WIRE_TYPESUPPORTS, TYPESUPPORT, PYTHON)
"""Whose output is compiled."""

_ALWAYS = {"action_msgs", "builtin_interfaces", "service_msgs", "unique_identifier_msgs"}
"""What services and actions are made of, though no definition names it."""
_INCLUDE = re.compile(r'^#include "(\w+)/', re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Sources:
    """What was generated."""

    package: InterfacePackage
    work: Path
    """A folder for each of `GENERATORS`, with one of the package's name in it."""
    needs: list[str]
    """The packages that it is made of."""

    @property
    def interfaces(self) -> Path:
        """Return the folder of its .idl files."""
        return self.work / "idl" / self.package.name

    def folder(self, generator: str) -> Path:
        """Return where a generator wrote."""
        return self.work / generator / self.package.name


def generate_sources(package: InterfacePackage, *, share: Path, work: Path) -> Sources:
    """Generate everything that is then compiled.

    Args:
        package: The package.
        share: Where ROS's packages have their .idl files: `share` of the venv.
        work: An empty folder.
    """
    from rosidl_generator_c import generate_c
    from rosidl_generator_py.generate_py_impl import generate_py
    from rosidl_generator_type_description import generate_type_hash
    from rosidl_typesupport_c import generate_c as generate_typesupport_c
    from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c
    from rosidl_typesupport_introspection_c import generate_c as generate_introspection_c

    sources = Sources(package, work, _needs_of(package, share))
    with contextlib.redirect_stdout(io.StringIO()):  # each file's name
        names = _convert_to_idl(sources)

        def arguments(generator: str, **more: Any) -> str:
            return str(_arguments_file(sources, generator, names, share, more))

        generate_type_hash(
            arguments(TYPE_DESCRIPTION, include_paths=[f"{n}:{share / n}" for n in sources.needs])
        )
        hashes = [
            f"{n}:{(sources.folder(TYPE_DESCRIPTION) / n).with_suffix('.json')}" for n in names
        ]
        generate_c(arguments(C, type_description_tuples=hashes))
        generate_typesupport_fastrtps_c(arguments(WIRE_TYPESUPPORTS[0]))
        generate_introspection_c(arguments(WIRE_TYPESUPPORTS[1]))
        generate_typesupport_c(arguments(TYPESUPPORT), list(WIRE_TYPESUPPORTS))
        generate_py(arguments(PYTHON), [TYPESUPPORT])
    _fill_in_headers(sources, share)
    return sources


def _needs_of(package: InterfacePackage, share: Path) -> list[str]:
    """Return all packages that it needs, and that those need."""
    found = set[str]()
    waiting = package.named_packages | _ALWAYS
    while waiting:
        name = waiting.pop()
        files = list((share / name).glob("*/*.idl"))
        if not files:
            raise SystemExit(f"{package.name} needs {name}, which is not installed in {share}.")
        found.add(name)
        for path in files:
            waiting |= set(_INCLUDE.findall(path.read_text(encoding="utf-8"))) - found
    return sorted(found)


def _convert_to_idl(sources: Sources) -> list[str]:
    """Write the .idl files; return their names, such as `msg/DoorMap.idl`."""
    from rosidl_adapter.action import convert_action_to_idl
    from rosidl_adapter.msg import convert_msg_to_idl
    from rosidl_adapter.srv import convert_srv_to_idl

    convert: dict[str, Callable[..., Path]] = {
        ".msg": convert_msg_to_idl, ".srv": convert_srv_to_idl, ".action": convert_action_to_idl,
    }  # fmt: skip
    package = sources.package
    names = []
    for path in package.definitions:
        relative = path.relative_to(package.folder)
        target = sources.interfaces / relative.parent
        target.mkdir(parents=True, exist_ok=True)
        convert[path.suffix](package.folder, package.name, relative, target)
        names.append(str(relative.with_suffix(".idl")))
    return names


def _arguments_file(
    sources: Sources, generator: str, names: list[str], share: Path, more: dict[str, Any]
) -> Path:
    sources.folder(generator).mkdir(parents=True)
    arguments = {
        "package_name": sources.package.name,
        "output_dir": str(sources.folder(generator)),
        "template_dir": str(share / generator / "resource"),
        "idl_tuples": [f"{sources.interfaces}:{name}" for name in names],
        "ros_interface_files": [str(path) for path in sources.package.definitions],
        "ros_interface_dependencies": [
            f"{need}:{path}"
            for need in sources.needs
            for path in sorted((share / need).glob("*/*.idl"))
        ],
        "target_dependencies": [],
        **more,
    }
    path = sources.work / f"{generator}.json"
    path.write_text(json.dumps(arguments), encoding="utf-8")
    return path


def _fill_in_headers(sources: Sources, share: Path) -> None:
    """Write the headers about symbols' visibility, which CMake would configure."""
    name = sources.package.name
    for generator in (C, *WIRE_TYPESUPPORTS):
        for template in (share / generator / "resource").glob("*visibility_control.h.in"):
            text = template.read_text(encoding="utf-8")
            text = text.replace("@PROJECT_NAME_UPPER@", name.upper()).replace(
                "@PROJECT_NAME@", name
            )
            header = sources.folder(generator) / "msg" / template.stem
            header.parent.mkdir(exist_ok=True)
            header.write_text(text, encoding="utf-8")
