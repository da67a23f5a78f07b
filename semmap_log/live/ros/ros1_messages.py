"""The thesis's messages for rospy: those of the robot's workspace, else made from our own files.

genpy writes plain Python from the texts of messages, in a third of a second: neither catkin nor a
build is needed. What catkin's genaction.py does, an action is split into seven messages.
"""

from __future__ import annotations

import importlib
import re
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from importlib.resources import as_file, files
from pathlib import Path
from types import ModuleType
from typing import Any

from semmap_log.errors import RosError

PACKAGE = "lta_semantic_map"

_HEADER = "std_msgs/Header header\n"
_GOAL_ID = "actionlib_msgs/GoalID goal_id\n"
_STATUS = "actionlib_msgs/GoalStatus status\n"
_FOREIGN = re.compile(r"^\s*(\w+/\w+|Header)(?:\s*\[\d*\])?\s+\w", re.MULTILINE)
"""A field whose type is another package's; `Header` is short for std_msgs/Header."""
_OWN = re.compile(r"^(?=[A-Z])(?!Header\b)", re.MULTILINE)
"""Before a field whose type is of the same package."""


def message_module() -> ModuleType:
    """Return `lta_semantic_map.msg`, with its messages and all that its actions are made of.

    Raises:
        RosError: It is not there, and genpy is not either.
    """
    module = _installed()
    if module is not None:
        return module
    with ExitStack() as stack:
        package = stack.enter_context(
            as_file(files("semmap_log") / "live" / "robot_files" / PACKAGE)
        )
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="semmap_ros1_")))
        generate(package, into=folder)
        stack.enter_context(_first_on_path(folder))
        return importlib.import_module(f"{PACKAGE}.msg")


def generate(package: Path, *, into: Path) -> None:
    """Write a ROS package's messages, services and actions as Python modules.

    Args:
        package: A folder with `msg`, `srv` or `action`; its name is the package's.
        into: Gets a folder of that name. What other packages the definitions name must be
            importable.

    Raises:
        RosError: genpy is not here, or refuses a definition.
    """
    generators = _generators()
    with tempfile.TemporaryDirectory(prefix="semmap_genpy_") as work:
        messages = _texts(package, "msg")
        for name, text in _texts(package, "action").items():
            messages |= action_messages(name, text)
        search = _write_definitions(Path(work), package.name, messages, _texts(package, "srv"))
        target = into / package.name
        target.mkdir(parents=True, exist_ok=True)
        (target / "__init__.py").touch()
        for kind, generator in generators.items():
            paths = sorted(Path(work).glob(f"{package.name}/*.{kind}"))
            if paths:
                _run(generator, paths, search, target / kind)


def action_messages(name: str, text: str) -> dict[str, str]:
    """Return the seven messages of an action: name -> text.

    As actionlib_msgs' genaction.py splits it (BSD; Willow Garage, 2009), so that the checksums are
    those of any robot's workspace.

    Raises:
        RosError: It does not have three parts.
    """
    parts = [part.lstrip("\n") for part in re.split(r"^---$", text, flags=re.MULTILINE)]
    if len(parts) != 3:
        raise RosError(f"{name}.action: expected goal, result and feedback, parted by two lines "
                       f"of ---, got {len(parts)} parts.")  # fmt: skip
    goal, result, feedback = parts
    return {
        f"{name}Goal": goal,
        f"{name}Result": result,
        f"{name}Feedback": feedback,
        f"{name}ActionGoal": f"{_HEADER}{_GOAL_ID}{name}Goal goal\n",
        f"{name}ActionResult": f"{_HEADER}{_STATUS}{name}Result result\n",
        f"{name}ActionFeedback": f"{_HEADER}{_STATUS}{name}Feedback feedback\n",
        f"{name}Action": f"{name}ActionGoal action_goal\n"
        f"{name}ActionResult action_result\n"
        f"{name}ActionFeedback action_feedback\n",
    }


def _installed() -> ModuleType | None:
    """Return the messages that are installed, as by catkin; None: there are none."""
    try:
        module = importlib.import_module(f"{PACKAGE}.msg")
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != PACKAGE:
            raise RosError(
                f"{PACKAGE}.msg is here, but needs {error.name}, which is not."
            ) from error
        return None
    if hasattr(module, "DoorMap"):
        return module
    # A folder of definitions in the current directory: Python takes it for an empty package.
    for name in (f"{PACKAGE}.msg", PACKAGE):
        del sys.modules[name]
    return None


def _generators() -> dict[str, Any]:
    """Return genpy's own: kind of definition -> what writes its modules."""
    try:
        from genpy.generator import MsgGenerator, SrvGenerator
    except ImportError as error:
        raise RosError(
            f"ROS 1 is not installed for this Python ({sys.executable}): no genpy. "
            "On Debian: apt-get install python3-rospy python3-actionlib."
        ) from error
    return {"msg": MsgGenerator(), "srv": SrvGenerator()}


def _texts(package: Path, kind: str) -> dict[str, str]:
    """Return the definitions of a kind: name -> text."""
    paths = package.glob(f"{kind}/*.{kind}")
    return {path.stem: path.read_text(encoding="utf-8") for path in paths}


def _write_definitions(
    work: Path, package: str, messages: dict[str, str], services: dict[str, str]
) -> dict[str, list[str]]:
    """Write all texts that genpy needs; return package -> its folders, as it wants them."""
    for suffix, texts in (("msg", messages), ("srv", services)):
        for name, text in texts.items():
            _write(work / package / f"{name}.{suffix}", text)
    for foreign, text in _foreign_texts([*messages.values(), *services.values()], but=package):
        _write(work / f"{foreign}.msg", text)
    return {folder.name: [str(folder)] for folder in work.iterdir()}


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")


def _foreign_texts(texts: Iterable[str], *, but: str) -> Iterator[tuple[str, str]]:
    """Yield each other package's message that the texts need, in turn with all that it needs.

    Debian does not ship the texts of messages; each generated class knows its own.
    """
    seen = set[str]()
    waiting = list(texts)
    while waiting:
        for found in _FOREIGN.findall(waiting.pop()):
            name = "std_msgs/Header" if found == "Header" else found
            package = name.split("/")[0]
            if package != but and name not in seen:
                seen.add(name)
                text = _text_of_installed(name)
                waiting.append(_OWN.sub(f"{package}/", text))
                yield name, text


def _text_of_installed(name: str) -> str:
    """Return the definition of an installed message, such as `std_msgs/Header`."""
    package, _, kind = name.partition("/")
    try:
        full = getattr(importlib.import_module(f"{package}.msg"), kind)._full_text  # noqa: SLF001
    except (ImportError, AttributeError) as error:
        raise RosError(
            f"{name} is not installed for this Python ({sys.executable}). "
            f"On Debian: apt-get install python3-{package.replace('_', '-')}."
        ) from error
    return str(full).partition("\n" + "=" * 80)[0] + "\n"


def _run(generator: Any, paths: list[Path], search: dict[str, list[str]], out: Path) -> None:
    """Have a kind of definitions written as modules, with an `__init__` that imports them all."""
    from genpy.generate_initpy import write_modules

    package = out.parent.name
    out.mkdir(exist_ok=True)
    if generator.generate_messages(package, [str(path) for path in paths], str(out), search):
        raise RosError(f"{package}: genpy refuses a definition; it says above which, and why.")
    write_modules(str(out))


@contextmanager
def _first_on_path(folder: Path) -> Iterator[None]:
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))
