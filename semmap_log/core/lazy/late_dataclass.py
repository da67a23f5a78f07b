"""`dataclass` with slots, whose methods are made when one of them is first used.

The library writes the methods of a class as text and compiles it: .4 ms a class. A program that
asks a log one question loads a hundred such classes, and makes objects of a third of them. So the
rooms that reading loads take `dataclass` from here. The class is there at once, with its slots; its
methods, and what is told of its fields, are the library's own, made when they are asked for.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Iterator
from inspect import get_annotations
from typing import TYPE_CHECKING, Any, Literal, TypeVar

C = TypeVar("C", bound=type)

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # noqa: PLC0414 - others take it from here
else:

    def dataclass(
        *,
        slots: Literal[True],
        frozen: bool = False,
        eq: bool = True,
        repr: bool = True,  # noqa: A002 - as the library has it
        order: bool = False,
        kw_only: bool = False,
    ) -> Callable[[C], C]:
        """Return what makes a class a dataclass, as `dataclasses.dataclass` with these options.

        Args:
            slots: Only then does the library, too, make a class anew of the written one.
            frozen: As the library's, and so the rest.
            eq: Compare by the fields.
            repr: Show them.
            order: Sort by them.
            kw_only: Take them by name only.
        """
        given = {"frozen": frozen, "eq": eq, "repr": repr, "order": order, "kw_only": kw_only}
        return lambda written: _Recipe(written, {"slots": slots, **given}).made


class _Recipe:
    """What the methods of a class are made of: any number of times, always the same."""

    def __init__(self, written: type, options: dict[str, bool]) -> None:
        own = {n: v for n, v in vars(written).items() if n not in ("__dict__", "__weakref__")}
        fields = dict.fromkeys(_field_names(written))
        taken = {name for base in written.__mro__[1:] for name in vars(base).get("__slots__", ())}
        slots = tuple(name for name in fields if name not in taken)
        late = {name: _Late(name, self) for name in _made(options) if own.get(name) is None}
        self._written = {**own, "__qualname__": written.__qualname__}
        self._options = options
        kept = {name: held for name, held in self._written.items() if name not in fields}
        self.made = self._class_of({**kept, **late, "__slots__": slots}, like=written)

    def follow(self, asked: str) -> None:
        """Give the class what is asked for; threads that do it at the same time do the same.

        Most objects are made, and never compared or shown: what that takes is left out until then.
        """
        first = asked in _FIRST and not self._options["order"]
        options = {**self._options, "repr": False, "eq": False} if first else self._options
        copy = self._class_of(self._written, like=self.made)
        whole = vars(dataclasses.dataclass(**options)(copy))
        for name, held in list(vars(self.made).items()):
            if isinstance(held, _Late) and (name in _FIRST or not first):
                setattr(self.made, name, whole[name])

    @staticmethod
    def _class_of(members: dict[str, Any], *, like: type) -> Any:
        return type(like)(like.__name__, like.__bases__, dict(members))


class _Late:
    """Stands in a class for what is not made yet."""

    __slots__ = ("_name", "_recipe")

    def __init__(self, name: str, recipe: _Recipe) -> None:
        self._name = name
        self._recipe = recipe

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        made = self._recipe.made
        if vars(made)[self._name] is self:
            self._recipe.follow(self._name)
        found = vars(made)[self._name]
        return found.__get__(instance, owner) if hasattr(found, "__get__") else found


_FIRST = frozenset(
    ("__init__", "__match_args__", "__setattr__", "__delattr__", "__getstate__", "__setstate__",
     "__dataclass_fields__")
)  # fmt: skip
"""What it takes to make an object, and to be the base of another class."""


def _made(options: dict[str, bool]) -> Iterator[str]:
    """Yield the names of what the library gives to a class with these options."""
    yield from ("__init__", "__match_args__", "__dataclass_fields__", "__dataclass_params__")
    if options["repr"]:
        yield "__repr__"
    if options["eq"]:
        yield from ("__eq__", "__hash__")
    if options["order"]:
        yield from ("__lt__", "__le__", "__gt__", "__ge__")
    if options["frozen"]:
        yield from ("__setattr__", "__delattr__", "__getstate__", "__setstate__")
    if sys.version_info >= (3, 13):
        yield "__replace__"


def _field_names(written: type) -> Iterator[str]:
    """Yield the fields of a class, inherited ones first."""
    for base in reversed(written.__mro__):
        if base is written or "__dataclass_fields__" in vars(base):
            for name, hint in get_annotations(base).items():
                if not hint.startswith("ClassVar"):
                    yield name
