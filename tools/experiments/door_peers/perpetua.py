r"""A peer: Perpetua, by the program that its authors published.

Saavedra-Ruiz, Nashed, Gauthier and Paull, Perpetua: Multi-Hypothesis Persistence Modeling for
Semi-Static Environments, IROS 2025. It needs a Python of its own (3.10: its classes have defaults
that later ones refuse), and their code beside it:

    git clone https://github.com/montrealrobotics/perpetua-code
    python3.10 -m venv perpetua-venv
    perpetua-venv/bin/pip install 'jax<0.5' 'flax<0.11' ruptures tqdm PyYAML
    perpetua-venv/bin/pip install scipy pandas scikit-learn prettytable matplotlib SciencePlots
    export PYTHONPATH=$PWD/perpetua-code JAX_PLATFORM_NAME=cpu JAX_ENABLE_X64=1
    peer="perpetua-venv/bin/python tools/experiments/door_peers/perpetua.py"
    python tools/experiments/eval_doors.py FOLDER --step 600 --mode patrol_30m \
        --peer perpetua="$peer"

Theirs: the filters, the E step, the choice of one to three components by AIC with retraining, the
starting values, the search for changes of the state (`ruptures`). As in their example of a room
are: eps 0.1, five steps between two times, thresholds 0.05 and 0.95, five readings for a change to
be told at a price of 3, an empty model that takes a second. Ours: EM's sequences go in one batch
(theirs compiles anew for each length), cut to 128 readings; 60 iterations at most, not 250, and
none for less than a thousandth of a nat; two retrainings, not five; it learns from the last 4,000
readings before the first forecast, and from 48 sequences of a kind at most, evenly over that time.
An hour ahead and more the future is simulated each half an hour, not in five steps, and for 72
hours at most.

Its settings are those that forecast these readings best, each from those before it (Brier score),
as far ahead as is asked: exponential or log-normal, changes found by theirs or by a two-state
Viterbi (at 2 or 4 nats a change), thresholds 0.05, 0.25 and 0.5 (their examples have 0.05 and 0.5).
They are learnt once for each door, spacing of readings and lead, from the first seed, and hold for
the others.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import product
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import src.learning.mixture_exponential as exponential
import src.learning.mixture_lognormal as lognormal
from asks import Ask, Floats, Readings, answer_all
from chained import states, trials
from jax._src.tree_util import Partial
from numpy.typing import NDArray
from src.filters import Perpetua
from src.learning.learning_utils import compute_marginals, create_filter
from src.utils import priors
from src.utils.cpd_utils import detect_change_points

EPS, STEPS = 0.1, 5
MIN_SIZE, PENALTY = 5, 3
PRICES = (2.0, 4.0)
THRESHOLDS = (0.05, 0.25, 0.5)
MOST_READINGS, MOST_SEQUENCES = 4_000, 48
ITERATIONS, RETRAININGS, CONVERGED = 60, 2, 1e-3
COMPONENTS = range(1, 4)
PRUNED = 0.01
NO_WEIGHT = 1e-12
LENGTHS = (32, 128)
"""Of sequences: few, since each is compiled."""
GRID_S = 1800.0
"""Farther ahead the future is simulated in steps of so much at most."""
MOST_AHEAD_S = 72 * 3600.0
"""Farther ahead it is not simulated: the forecast is that of so long."""
ROW = 32
"""So many forecasts at most are made from a state in one call."""

PRIORS = {
    "lognorm": Partial(priors.log_survival_lognormal),
    "exponential": Partial(priors.log_survival_exponential),
}
EMPTY = {
    "lognorm": {"logmu": jnp.array([0.0]), "std": jnp.array([0.1]), "pi": jnp.array([1.0])},
    "exponential": {"lambda_": jnp.array([1.0]), "pi": jnp.array([1.0])},
}

Model = dict[str, Any]
Sequences = list[tuple[Floats, Floats]]
"""(times from the first on, readings) of each."""


@dataclass(frozen=True)
class Settings:
    prior: str
    persistence: Model
    emergence: Model
    threshold: float


def sequences(readings: Readings, changes: list[int]) -> tuple[Sequences, Sequences]:
    """Return sequences of a state and the one after it: of open, and of closed.

    What is open in most readings of its first part persists. Where one of the two never ends, all
    readings are one sequence. Both as `extract_sequences` of theirs.
    """
    found: tuple[Sequences, Sequences] = ([], [])

    def take(start: int, middle: int, end: int) -> None:
        is_open = bool(np.median(readings.reads_open[start:middle]) >= 0.5)
        kept = start + thinned(middle - start, end - middle)
        reads_open = readings.reads_open[kept].astype(np.float64)
        found[not is_open].append((readings.times_s[kept] - readings.times_s[start], reads_open))

    bounds = [0, *changes]
    for start, middle, end in zip(bounds, bounds[1:], bounds[2:]):  # noqa: B905 - they overlap
        take(start, middle, end)
    if not found[0] or not found[1]:
        take(0, len(readings), len(readings))
    return evenly(found[0]), evenly(found[1])


def thinned(first: int, second: int) -> NDArray[np.intp]:
    """Return which readings of two states make a sequence that is short enough: all, if it is.

    Of a longer one the end of the second state is left out first, then evenly of the first one.
    """
    behind = min(second, max(LENGTHS[-1] - first, LENGTHS[-1] // 4))
    before = min(first, LENGTHS[-1] - behind)
    kept = np.linspace(0, first - 1, before).astype(np.intp)
    return np.concatenate([kept, first + np.arange(behind)])


def evenly(all_of: Sequences) -> Sequences:
    chosen = np.linspace(0, len(all_of) - 1, min(len(all_of), MOST_SEQUENCES)).astype(int)
    return [all_of[n] for n in chosen]


def fitted(kind: str, prior: str, seen: Sequences, missed: float, false: float) -> Model:
    """Return a mixture of priors of durations, by their choice of the number of components."""
    if not seen:
        return EMPTY[prior]
    batch = tuple(jnp.array(column) for column in padded(seen))
    module = lognormal if prior == "lognorm" else exponential
    fit = partial(_fit, kind, prior, batch, (_strong(missed), _strong(false)))
    found = module.select_and_refine_model(
        fit,
        jnp.linspace(0.0, max(float(times[-1]) for times, _ in seen), 1001),
        sum(len(times) for times, _ in seen),
        COMPONENTS,
        jnp.full(3 if prior == "lognorm" else 2, 0.1),
        num_retrain_attempts=RETRAININGS,
        prune_threshold=PRUNED,
        key=jax.random.PRNGKey(12345),
    )
    if prior == "lognorm":
        return {"logmu": found["mu"], "std": found["sigma"], "pi": found["pi"]}
    return {"lambda_": found["lambda"], "pi": found["pi"]}


def of_three(model: Model) -> Model:
    """Return the same mixture, with copies of its first component that weigh nothing.

    So filters of all doors have one shape, and are compiled once.
    """
    more = COMPONENTS[-1] - len(model["pi"])
    copies = {name: jnp.repeat(values[:1], more) for name, values in model.items()}
    copies["pi"] = jnp.full(more, NO_WEIGHT)
    return {name: jnp.concatenate([values, copies[name]]) for name, values in model.items()}


def padded(seen: Sequences) -> tuple[Floats, Floats, Floats]:
    """Return (times, readings, weights) of sequences as one batch of one of `LENGTHS`.

    Behind the last reading follow pairs of one closed and one open. Where the sensor errs as often
    either way they say nothing about when the state ended: whenever it did, both together have the
    same probability. An odd last reading is left out.
    """
    longest = max(len(times) for times, _ in seen)
    length = min(at for at in LENGTHS if at >= longest)
    times_s = np.tile(np.arange(1.0, length + 1), (MOST_SEQUENCES, 1))
    reads_open = np.tile(np.arange(length) % 2.0, (MOST_SEQUENCES, 1))
    for n, (times, reads) in enumerate(seen):
        count = len(times) - len(times) % 2
        times_s[n, :count], reads_open[n, :count] = times[:count], reads[:count]
        times_s[n, count:] = times[count - 1] + np.arange(1, length - count + 1)
    return times_s, reads_open, (np.arange(MOST_SEQUENCES) < len(seen)).astype(np.float64)


def _fit(
    kind: str, prior: str, batch: Any, errors: Any, *, pi_init: Any, mu_init: Any = None,
    sigma_init: Any = None, lambda_init: Any = None,
) -> tuple[Any, ...]:  # fmt: skip
    """Return the parameters, weights and log-evidence that EM ends with: their `fit`."""
    starts = (mu_init, sigma_init) if prior == "lognorm" else (lambda_init,)
    pi, *params = (jnp.asarray(one, jnp.float64) for one in (pi_init, *starts))
    best, before = (*params, pi, -np.inf), -np.inf
    for _ in range(ITERATIONS):
        pi, params, evidence = _em_step((kind, prior), batch, errors, pi, tuple(params))
        evidence = float(evidence)
        if evidence > best[-1]:
            best = (*params, pi, evidence)
        if abs(evidence - before) < CONVERGED or np.isnan(evidence):
            break
        before = evidence
    return best


@partial(jax.jit, static_argnums=0)
def _em_step(
    how: tuple[str, str], batch: Any, errors: Any, pi: Any, params: Any
) -> tuple[Any, Any, Any]:
    """Return the next weights and parameters, and their log-evidence: their `em_step`."""
    kind, prior = how
    times, reads, weight = batch
    state = _state(kind, prior, pi, params)
    process = lognormal.process_sequence_mu if prior == "lognorm" else exponential.process_sequence

    def expected(at: Any, read: Any) -> Any:
        return process(kind, at, read, pi, *params, state, *errors)

    def spread(at: Any, read: Any, mu: Any) -> Any:
        return lognormal.process_sequence_var(kind, at, read, pi, *params, mu, state, *errors)

    ages, shares = jax.vmap(expected)(times, reads)
    age, share = weight @ ages, weight @ shares
    pi_next = jnp.clip(share / share.sum(), 1e-10, 1.0)
    if prior == "exponential":
        found = (jnp.clip(share / age, 1e-10, 1e15),)
    else:
        mu = age / share
        squares = weight @ jax.vmap(spread, (0, 0, None))(times, reads, mu)
        found = (jnp.clip(mu, 1e-10, 1e15), jnp.clip(jnp.sqrt(squares / share), 1e-10, 1e15))
    after = _state(kind, prior, pi_next, found)

    def evidence(at: Any, read: Any) -> Any:
        return compute_marginals(kind, after, read, at, *errors)[0]

    return pi_next, found, weight @ jax.vmap(evidence)(times, reads)


def _state(kind: str, prior: str, pi: Any, params: Any) -> Any:
    names = ("logmu", "std") if prior == "lognorm" else ("lambda_",)
    named = dict(zip(names, params, strict=True))
    return create_filter(kind, PRIORS[prior], named, pi, initialization_time=0.0)


_models: dict[tuple[Any, ...], list[tuple[str, Model, Model]]] = {}
"""(door, spacing) -> what was learnt of durations, once for all seeds and leads."""
_settings: dict[tuple[Any, ...], Settings] = {}
"""(door, spacing, lead) -> what forecast best, once for all seeds."""


def models(ask: Ask, readings: Readings) -> list[tuple[str, Model, Model]]:
    """Return (prior, persistence, emergence) of each way to learn them."""
    missed, false = float(np.median(readings.missed)), float(np.median(readings.false))
    if (key := ask.series) not in _models:
        reads = readings.reads_open.astype(np.float64)
        theirs = detect_change_points(reads, readings.times_s, min_size=MIN_SIZE, pentalty=PENALTY)
        likely = [
            [*(np.flatnonzero(np.diff(states(readings, price))) + 1).tolist(), len(readings)]
            for price in PRICES
        ]
        _models[key] = [
            (
                prior,
                of_three(fitted("persistence", prior, opened, missed, false)),
                of_three(fitted("emergence", prior, closed, missed, false)),
            )
            for changes in (theirs, *likely)
            for opened, closed in [sequences(readings, changes)]
            for prior in PRIORS
        ]
    return _models[key]


def learnt(ask: Ask) -> Settings:
    """Return the settings that forecast the training part of the first seed best."""
    key = (*ask.series, round(ask.ahead_s))
    if key not in _settings:
        _settings[key] = _best(ask)
    return _settings[key]


def _best(ask: Ask) -> Settings:
    readings = ask.readings[max(0, ask.training - MOST_READINGS) : ask.training]
    last, asked = trials(readings, ask.ahead_s)
    tried = [
        Settings(*found, threshold)
        for found, threshold in product(models(ask, readings), THRESHOLDS)
    ]

    def brier(settings: Settings) -> float:
        p_open = forecasts(settings, readings, readings.times_s[asked], last)
        p_reads = readings.p_reads_open(p_open, asked)
        lost = float(np.mean((p_reads - readings.reads_open[asked]) ** 2))
        return lost if np.isfinite(lost) else np.inf

    return min(tried, key=brier)


def forecasts(
    settings: Settings, readings: Readings, times_s: Floats, last: NDArray[np.intp]
) -> Floats:
    """Return P(open) at some times, each by the readings up to its `last`."""
    rows, at = _rows(readings, times_s, last)
    p_rows = np.asarray(_run(settings, readings, rows))
    p_open = np.empty(len(times_s))
    p_open[at[0]] = p_rows[at[1], at[2]]
    return np.nan_to_num(p_open, nan=0.5)


def _rows(
    readings: Readings, times_s: Floats, last: NDArray[np.intp]
) -> tuple[dict[str, Any], tuple[Any, Any, Any]]:
    """Return readings and forecasts as rows in order of time, and where each forecast is."""
    order = np.lexsort((times_s, last))
    run = np.concatenate([[0], np.cumsum(np.diff(last[order]) != 0)]) if len(order) else order
    first = np.searchsorted(run, run)
    place = (np.arange(len(order)) - first) % ROW
    begins = np.flatnonzero(place == 0)
    number = np.cumsum(place == 0) - 1
    width = int(place.max(initial=0)) + 1
    asked_at = last[order][begins]
    # A row of forecasts comes behind the reading that it may know.
    key = np.concatenate([np.arange(len(readings)) * 2, asked_at * 2 + 1])
    where = np.argsort(key, kind="stable")
    row_of = np.empty(len(where), np.intp)
    row_of[where] = np.arange(len(where))
    asked = np.empty((len(begins), width))
    asked[:] = times_s[order][np.append(begins[1:], len(order)) - 1][:, None]
    asked[number, place] = times_s[order]
    total, readings_count = len(where), len(readings)
    is_ask = np.zeros(total, np.bool_)
    is_ask[row_of[readings_count:]] = True
    queries = np.zeros((total, width))
    queries[row_of[readings_count:]] = asked
    columns = {
        "time": readings.times_s, "reads_open": readings.reads_open.astype(np.float64),
        "missed": readings.missed, "false": readings.false,
    }  # fmt: skip
    rows: dict[str, Any] = {"is_ask": is_ask, "queries": queries}
    for name, values in columns.items():
        rows[name] = np.zeros(total)
        rows[name][row_of[:readings_count]] = values
    # Rows behind the last reading are padded, so that few numbers of rows are compiled.
    padded = int(2 ** np.ceil(np.log2(max(total, 256))))
    rows = {
        name: np.concatenate([values, np.zeros((padded - total, *values.shape[1:]), values.dtype)])
        for name, values in rows.items()
    }
    rows["is_there"] = np.arange(padded) < total
    lead_s = float(np.max(asked[:, 0] - readings.times_s[asked_at], initial=0.0))
    rows["grid"] = int(np.ceil(lead_s / GRID_S)) if lead_s >= 2 * GRID_S else 0
    return rows, (order, row_of[readings_count:][number], place)


def _run(settings: Settings, readings: Readings, rows: dict[str, Any]) -> Any:
    """Return what is forecast in each row: nothing in those of readings."""
    both = (settings.persistence, settings.emergence)
    params = [{name: one[name] for name in one if name != "pi"} for one in both]
    survives, start_s = PRIORS[settings.prior], float(readings.times_s[0]) - 1.0
    is_dense = float(np.median(np.diff(readings.times_s))) < GRID_S
    state = Perpetua.init(
        survives, survives, *params, *(one["pi"] for one in both),
        settings.threshold, 1 - settings.threshold, start_s, 1 if is_dense else STEPS, EPS,
    )  # fmt: skip
    state = jax.tree_util.tree_map(_strong, state)
    # Two readings by themselves: after them all parts of the state have the shapes that they keep.
    first = np.flatnonzero(~rows["is_ask"] & rows["is_there"])[:2]
    for n in first.tolist():
        state = Perpetua.update(
            state, rows["reads_open"][n], rows["time"][n], rows["missed"][n], rows["false"][n]
        )
    rows["is_there"] = rows["is_there"] & ~np.isin(np.arange(len(rows["time"])), first)
    return _scan(rows.pop("grid"))(jax.tree_util.tree_map(_strong, state), rows)


def _strong(value: Any) -> Any:
    """Return a number of the type that it keeps."""
    array = np.asarray(value)
    return jnp.array(array.astype(np.float64) if array.dtype == np.float32 else array)


@lru_cache
def _scan(grid: int) -> Any:
    """Return a compiled run over rows: readings move the state, forecasts are made from it."""

    def ask(state: Any, row: Any) -> Any:
        start = state.last_observation_time
        before = start + (row["queries"][0] - start) * jnp.arange(1, grid + 1) / (grid + 1)
        p, _, weights = Perpetua.predict(state, jnp.concatenate([before, row["queries"]]))
        # The likeliest pair of components speaks, as in their `process_predictions`.
        return p[jnp.arange(p.shape[0]), jnp.argmax(weights, axis=1)][grid:]

    def body(state: Any, row: Any) -> Any:
        reads = row["is_there"] & ~row["is_ask"]
        moved = jax.lax.cond(
            reads,
            lambda: _like(
                Perpetua.update(state, row["reads_open"], row["time"], row["missed"], row["false"]),
                state,
            ),
            lambda: state,
        )
        p = jax.lax.cond(
            row["is_there"] & row["is_ask"],
            lambda: ask(state, row),
            lambda: jnp.zeros(row["queries"].shape),
        )
        return moved, p

    return jax.jit(lambda state, rows: jax.lax.scan(body, state, rows)[1])


def _like(state: Any, before: Any) -> Any:
    """Return a state whose numbers are of the types that they were of."""
    return jax.tree_util.tree_map(
        lambda new, old: jnp.asarray(new, old.dtype).reshape(old.shape), state, before
    )


def predict(ask: Ask) -> Floats:
    """Return P(open) of what is asked."""
    p_open = np.full(len(ask.times_s), 0.5)
    known = ask.last >= 0
    if ask.training < 20 or not known.any():
        return p_open
    settings = learnt(ask)
    lead_s = np.where(known, ask.times_s - ask.readings.times_s[ask.last], 0.0)
    # The few behind an outage go by themselves: all of a run are simulated as far ahead.
    usual = lead_s <= 2 * ask.ahead_s + GRID_S
    for chosen in (known & usual, known & ~usual):
        if chosen.any():
            last = ask.last[chosen]
            times_s = ask.readings.times_s[last] + np.minimum(lead_s[chosen], MOST_AHEAD_S)
            p_open[chosen] = forecasts(settings, ask.readings, times_s, last)
    return p_open


if __name__ == "__main__":
    if not jax.config.jax_enable_x64:
        # Seconds of three years are no 32-bit floats; and their modules make numbers when imported.
        sys.exit("perpetua.py: export JAX_ENABLE_X64=1")
    answer_all(predict)
