"""A story that is disturbed again and again, each time in a folder of the same content."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random

from fault_injection import shim
from fault_injection.examiner import Examiner
from fault_injection.fault import Outcome, Plan, Tree, keep, write_tree
from fault_injection.forking import Ended, forked
from fault_injection.player import Player, Tell, Told
from fault_injection.shim import Action, Call, Entry
from fault_injection.story import story

EMPTY: Tree = {"out": {}}


class StoryBench:
    """Plays one story under the shim, and examines what is left of its log."""

    player: type[Player] = Player

    def __init__(self, plan: Plan, root: Path, seed: int, *, tail: int = 12) -> None:
        self.plan = plan
        self.root = root
        self.log = root / "log"
        self.name = f"story {seed}"
        self.story = story(seed, tail=tail)
        self.examiner = Examiner(self.story)
        self.random = Random(seed)

    def play(self, tell: Tell, level: str) -> None:
        """Play the story."""
        self.player(self.log, self.story, tell, level).play()

    def recorded(self, level: str) -> list[Entry]:
        """Return the calls of a run that nothing disturbs."""
        write_tree(self.root, EMPTY)
        with shim.recorded(self.root) as entries:
            self.play(shim.note, level)
        return entries

    def disturbed(
        self,
        work: Callable[[Tell], None],
        left: Tree,
        *,
        calls: Call,
        action: Action,
        first: int,
        count: int = 1,
        error: int = 0,
    ) -> Ended:
        """Work on a folder of that content in a child, while the shim acts on some calls."""

        def watched(tell: Tell) -> None:
            shim.watch(self.root)
            shim.arm(calls, action, first, count, error)
            work(tell)

        write_tree(self.root, left)
        return forked(watched)

    def examined(
        self, fault: str, left: Tree, told: Told, must: int, tell: Tell = lambda _: None
    ) -> Outcome:
        """Examine the log of the folder, whose content is kept if something is wrong.

        Args:
            fault: What was done.
            left: What it left.
            told: What the player was told.
            must: How many wishes must be there.
            tell: Hears what is promised meanwhile.
        """
        outcome = self.examiner.examine(fault, self.log, told, must=must, tell=tell)
        if outcome.is_good:
            return outcome
        return replace(outcome, kept=keep(self.plan.keep, fault, left))
