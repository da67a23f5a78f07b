"""What is done to a log: it is pinned, trimmed, compacted, copied, and asked by verbs."""

from __future__ import annotations

import random

import semmap_log as sl
from fault_injection.oracle.doors import stamp
from fault_injection.trimming.commands import ACTORS, KEYS
from fault_injection.trimming.life import Life, WrongError
from fault_injection.trimming.whole_log import EXPIRING

PINS = ("a", "b")
MANY = 30
"""Of so many repeated sightings some go; not all, where they lie in several segments."""
KEEP_COMMITS = 16
"""Of small segments: so many commits lie at most between a moment and the horizon before it."""
OUT = "{out}/made.html"


def pin(life: Life, dice: random.Random) -> None:
    """Give a moment a name."""
    times = [stamp(row)[0] for row in life.whole.rows.values()]
    at = dice.choice(times) + dice.choice((-1, 0, 1))
    name = dice.choice(PINS)
    answer = life.verb("pin", name, "--at", f"@{at}", good=False)
    if not answer.code:
        life.take_in()
    elif not life.whole.may_refuse(at=at):
        raise WrongError(f"pin: {answer.error}")


def thin(life: Life, dice: random.Random) -> None:
    """Take out sightings that repeat others."""
    whole, until_ns = life.whole, _moment(life, dice)
    before = whole.known_at(max(until_ns, whole.horizon_ns)) + 1
    may, must = (whole.repeated(before, surely=sure) - whole.gone.keys() for sure in (False, True))
    is_sure = not (whole.horizon or whole.has_retractions)
    life.verb("retain", "--thin", f"@{until_ns}")
    runs = [row for row in life.take_in_trimming() if row["kind"] == "SightingsThinned"]
    gone = whole.rows.keys() - whole.gone.keys() - life.left()
    _check_thinned(life, gone, before)
    seen = {number for number in gone if whole.rows[number]["kind"] == "DoorObserved"}
    worth = sum(row["count"] for row in runs)
    is_right = not is_sure or (seen <= may and (seen or len(must) < MANY))
    if worth != len(seen) or not is_right:
        raise WrongError(f"a thinning of events below {before} took out {sorted(seen)}, and "
                         f"says {worth}; of {sorted(may)}")  # fmt: skip


def _check_thinned(life: Life, gone: set[int], before: int) -> None:
    """Check that a thinning took out only what it may, and all poses; note what it took."""
    rows = [life.whole.rows[number] for number in sorted(gone)]
    wrong = [row for row in rows if row["event"] >= before
             or row["kind"] not in {"DoorObserved", "RobotPose"}]  # fmt: skip
    if wrong:
        raise WrongError(f"a thinning of events below {before} took out {wrong}")
    life.whole.gone |= dict.fromkeys(gone, "thinned")
    poses = [row["event"] for row in life.whole.rows.values() if row["kind"] == "RobotPose"]
    if left := {number for number in poses if number < before} - life.whole.gone.keys():
        raise WrongError(f"a thinning of events below {before} left poses {sorted(left)}")


def keep(life: Life, dice: random.Random) -> None:
    """Move the horizon."""
    until_ns = _moment(life, dice)
    life.verb("retain", "--keep", f"@{until_ns}")
    life.take_in_trimming()
    horizon = sl.read(life.path).horizon()
    if horizon < life.whole.horizon:
        raise WrongError(f"the horizon goes back from {life.whole.horizon} to {horizon}")
    if horizon > life.whole.horizon and life.whole.rows[horizon - 1]["recorded"] >= until_ns:
        raise WrongError(f"event {horizon - 1} went, and was recorded after {until_ns}")
    _check_moved(life, horizon, until_ns)
    life.whole.horizon = horizon
    kept = life.whole.setting_states(horizon)
    for number, row in life.whole.rows.items():
        if number < horizon and row["kind"] in EXPIRING and number not in kept:
            life.whole.gone.setdefault(number, "expired")


def _check_moved(life: Life, horizon: int, until_ns: int) -> None:
    """Check that the horizon moved where it can: small segments begin with keyframes."""
    known = [commit.last for commit in life.whole.commits if commit.closed_ns < until_ns]
    may_stay = not life.is_small or life.whole.has_retractions or len(known) <= KEEP_COMMITS
    if not may_stay and horizon <= known[-KEEP_COMMITS]:
        raise WrongError(f"the horizon is {horizon}, though {known} was known before")


def redact(life: Life, dice: random.Random) -> None:
    """Take out notes, tracks or what was said of a door."""
    until_ns = _moment(life, dice) if dice.random() < 0.4 else None
    before = (life.whole.last if until_ns is None else life.whole.known_at(until_ns)) + 1
    until = [] if until_ns is None else ["--until", f"@{until_ns}"]
    if until_ns is not None and life.whole.may_refuse(known_at=until_ns):
        return
    what = dice.choice(("notes", "actor", "tracks", "key", "key"))
    door, key, actor = dice.choice((1, 1, 2)), dice.choice(KEYS), dice.choice(ACTORS[1:])
    options = {"notes": ("--notes",), "tracks": ("--tracks",), "actor": ("--actor", actor),
               "key": ("--door", str(door), "--key", key)}[what]  # fmt: skip
    life.verb("redact", *options, *until)
    life.take_in_trimming()
    if what == "key":
        life.whole.forget_texts(door, key, before)
    elif what == "tracks":
        life.whole.forget_poses(before)
    else:
        life.whole.forget_notes(actor if what == "actor" else None, before)


def _moment(life: Life, dice: random.Random) -> int:
    """Return a moment at which something was recorded, or right after it; often the last."""
    commits = life.whole.commits
    commit = dice.choice((dice.choice(commits), commits[-1]))
    return commit.recorded_ns + dice.choice((0, 1, len(commit.numbers) + 2))


def compact(life: Life, dice: random.Random) -> None:
    """Merge and pack its files."""
    life.verb("compact", *dice.choice(([], ["--no-merge"], ["--free-now"])))


def index(life: Life, _: random.Random) -> None:
    """Make tables by door."""
    life.verb("index")


def copy(life: Life, dice: random.Random) -> None:
    """Copy it, or bring a copy up to date, and go on with the copy, or with the log.

    A copy whose last commit was taken out of the log since is refused: it fits no commit.
    """
    if not life.copies or dice.random() < 0.5:
        life.copies[life.room / f"copy{len(life.steps)}"] = -1
    target = dice.choice(list(life.copies))
    answer = life.verb("copy", str(target), good=False)
    if answer.code:
        if life.copies.pop(target) not in life.whole.gone:
            raise WrongError(f"copy: exit {answer.code}: {answer.error.strip()[-500:]}")
        return
    life.copies[target] = life.whole.last
    if dice.random() < 0.5:
        life.path = target
        life.copies = {}


def since_ever(life: Life, _: random.Random) -> None:
    """Say that doors were there before they were added: their addings are taken back."""
    added = [row["event"] for row in life.whole.visible() if row["kind"] == "DoorAdded"]
    answer = life.verb("import", "--since-ever", good=False)
    life.take_in()
    if answer.code and not any(map(life.may_refuse_retraction, added)):
        raise WrongError(f"import --since-ever: {answer.error.strip()[-500:]}")


def ask_others(life: Life, dice: random.Random) -> None:
    """Ask verbs whose answers nobody compares: they answer, or say why not."""
    number = dice.randint(0, life.whole.last)
    lines = (("show", str(number)), ("tail",), ("info",), ("probabilities",), ("report", OUT),
             ("best-time", "1"), ("diff", f"event:{number}", f"event:{life.whole.last}"),
             ("history", "1", "-n", "5"), ("evaluate", "--step", "600"))  # fmt: skip
    for line in dice.sample(lines, 2):
        life.verb(*line, good=line[0] in {"tail", "info"})
