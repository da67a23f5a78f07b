"""A class whose methods are made late is in all the one that the library would have made."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import pytest

from semmap_log.core.lazy.late_dataclass import _Late
from semmap_log.core.lazy.late_dataclass import dataclass as late

Maker = Callable[..., Callable[[type], type]]

OPTIONS: list[dict[str, bool]] = [
    {},
    {"frozen": True},
    {"frozen": True, "kw_only": True},
    {"frozen": True, "repr": False},
    {"frozen": True, "eq": False},
    {"eq": False},
    {"order": True},
    {"frozen": True, "order": True},
]


def _made(dataclass: Maker, options: dict[str, bool]) -> tuple[type[Any], type[Any]]:
    """Return a class, and one that is built on it, as somebody makes dataclasses."""

    class Base:
        """One field without a default, one with."""

        CONSTANT: ClassVar[int] = 7
        x: int
        names: list[str] = dataclasses.field(default_factory=list)

    made: Any = dataclass(**options, slots=True)(Base)

    class Derived(made):
        """Has a field more, another default of an inherited one, and a hidden one."""

        names: tuple[str, ...] = ()
        secret: bytes = dataclasses.field(default=b"", repr=False, compare=False)
        is_known: bool = dataclasses.field(default=False, init=False)
        places: dict[int, int] = dataclasses.field(default_factory=dict, init=False)

        def __post_init__(self) -> None:
            if self.x < 0:
                raise ValueError("x: expected 0 or more")

        def twice(self) -> int:
            return 2 * self.x

    return made, dataclass(**options, slots=True)(Derived)


Asked = Callable[[type[Any]], Any]
ASKED: dict[str, Asked] = {
    "shown": lambda cls: _without_places(repr(cls(x=1))),
    "equal": lambda cls: (cls(x=1) == cls(x=1), cls(x=1) == cls(x=2), cls(x=1) == 1),
    "hashed": lambda cls: cls.__hash__ is None or isinstance(hash(cls(x=1, names=())), int),
    "sorted": lambda cls: cls(x=1) < cls(x=2),
    "set": lambda cls: setattr(cls(x=1), "x", 2),
    "deleted": lambda cls: delattr(cls(x=1), "x"),
    "set to what is no field": lambda cls: setattr(cls(x=1), "y", 2),
    "signature": lambda cls: str(inspect.signature(cls)),
    "by place": lambda cls: cls(1, ()).names,
    "too few": lambda cls: cls(names=()),
    "not allowed": lambda cls: cls(x=-1).twice(),
    "fields": lambda cls: [
        (f.name, f.type, f.default, f.repr, f.compare, f.kw_only) for f in dataclasses.fields(cls)
    ],
    "asked of an object": lambda cls: len(dataclasses.fields(cls(x=1))),
    "replaced": lambda cls: dataclasses.replace(cls(x=1), x=3).x,
    "told": lambda cls: dataclasses.asdict(cls(x=1)),
    "copied": lambda cls: copy.deepcopy(cls(x=1)).x,
    "of the class": lambda cls: (cls.CONSTANT, cls.__doc__, cls.__qualname__, cls.__module__),
    "slots": lambda cls: (hasattr(cls(x=1), "__dict__"), type(cls.x), type(cls.names)),
    "set by nobody": lambda cls: (cls(x=1).is_known, cls(x=1).places),
    "matched": lambda cls: cls.__match_args__,
    "without having been made": lambda cls: object.__new__(cls).__class__ is cls,
    "is one": dataclasses.is_dataclass,
    "options": lambda cls: repr(cls.__dataclass_params__),
}


def _without_places(text: str) -> str:
    return text.partition(" object at")[0]


def _outcome(ask: Asked, cls: type[Any]) -> object:
    try:
        return ask(cls)
    except (AttributeError, TypeError, ValueError) as error:
        return type(error), str(error)


@pytest.mark.parametrize("options", OPTIONS, ids=repr)
@pytest.mark.parametrize("first", ASKED)
def test_it_does_all_that_the_librarys_does_whatever_is_asked_first(
    first: str, options: dict[str, bool]
) -> None:
    """
    Of the class, and of one that inherits from it: values, and the words of errors.
    """
    for mine, theirs in zip(
        _made(late, options), _made(dataclasses.dataclass, options), strict=True
    ):
        for name in (first, *ASKED):
            assert _outcome(ASKED[name], mine) == _outcome(ASKED[name], theirs), name


@pytest.mark.parametrize("options", OPTIONS, ids=repr)
def test_in_the_end_it_has_the_same_members(options: dict[str, bool]) -> None:
    """
    Nothing late is left once it was shown or compared; nothing is missing that the library makes.
    """
    for mine, theirs in zip(
        _made(late, options), _made(dataclasses.dataclass, options), strict=True
    ):
        mine.__dataclass_params__  # noqa: B018 - asks for all

        # Python 3.10 leaves behind a `__weakref__`, and gives an inherited field a second slot.
        apart = {"__weakref__", *(field.name for field in dataclasses.fields(mine))}
        members = [vars(cls).keys() - apart for cls in (mine, theirs)]
        assert members[0] == members[1]
        assert not [held for held in vars(mine).values() if isinstance(held, _Late)]


def test_an_object_is_made_without_what_shows_and_compares() -> None:
    """
    Half of the time is theirs.
    """
    _, cls = _made(late, {"frozen": True})

    assert isinstance(vars(cls)["__init__"], _Late)
    cls(x=1)
    assert not isinstance(vars(cls)["__init__"], _Late)
    assert isinstance(vars(cls)["__repr__"], _Late)


@late(frozen=True, slots=True)
class Stored:
    """A class that a pickle finds by its name."""

    x: int
    y: float = 0.5


def test_a_pickle_is_read_before_any_object_was_made() -> None:
    """
    Whoever reads it may be another process, which has made none.
    """
    data = pickle.dumps(Stored(1))
    program = f"import pickle; print(pickle.loads({data!r}))"

    root = Path(__file__).parents[1]
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=root)

    assert "Stored(x=1, y=0.5)\n" == done.stdout


def test_threads_that_ask_at_once_get_the_same() -> None:
    """
    No lock is held while methods are made, and none is needed.
    """
    for _ in range(20):
        _, cls = _made(late, {"frozen": True})
        start, said = threading.Barrier(4), list[str]()

        def ask(cls: type[Any], start: threading.Barrier, said: list[str]) -> None:
            start.wait()
            said.append(repr(cls(x=1)))

        threads = [threading.Thread(target=ask, args=(cls, start, said)) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

        assert 4 == len(said)
        assert 1 == len(set(said))
