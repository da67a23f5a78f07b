"""Every rule by which output suits people and scripts: tables, errors, times, completion."""

from __future__ import annotations

from mutation.mutant import mutants_in

PIPES = "tests/cli/test_pipes.py"
FAILURES = "tests/cli/test_failures.py"
COMPLETION = "tests/cli/test_completion.py"
REPEATS = "tests/test_repeats.py"
KEYS = "tests/formats/test_event_json_keys.py"

_put = mutants_in("semmap_log/")


HABITS = (
    _put("cells of a line are plain", "views/columns.py",
         'return "\\t".join(plain_cell(cell) for cell in cells)',
         'return "\\t".join(cells)', PIPES),
    _put("columns yield where it is narrow", "views/columns.py",
         "                del needs[place]", "                pass", PIPES),
    _put("what is left out is said", "cli/printer.py",
         "if left_out and left_out != self._left_out:", "if False:", PIPES),
    _put("an empty line between tables", "cli/printer.py",
         "if table.has_head and self._tables:", "if False:", PIPES),
    _put("NO_COLOR is the strongest", "cli/plain_console.py",
         'if os.environ.get("NO_COLOR"):', "if False:", PIPES),
    _put("a reader that goes", "cli/verbs.py", "        sys.exit(READER_GONE)",
         "        sys.exit(1)", PIPES),
    _put("an error as a document", "cli/__init__.py",
         "code = fail(error, as_json=asks_for_json(ours))", "code = fail(error, as_json=False)",
         FAILURES),
    _put("a document that has begun stays one", "cli/failures.py",
         "if has_begun or is_output_lost:", "if False:", FAILURES),
    _put("words behind -- are no options", "cli/failures.py",
         'return "--json" in arguments[:end]', 'return "--json" in arguments', FAILURES),
    _put("old names of ranges", "cli/verbs.py",
         "if new in options and old not in options:", "if False:", FAILURES),
    _put("two ends and a third", "cli/common.py", '    if ".." in since:', "    if False:",
         FAILURES),
    _put("problems of a kind are counted", "repeats.py",
         'return _VALUES.sub("…", text)', "return text", REPEATS),
    _put("completion is quiet", "cli/completion.py",
         "with suppress(Exception), warnings.catch_warnings():", "with warnings.catch_warnings():",
         COMPLETION),
    _put("names that need quotes", "cli/completion.py",
         "if _NEEDS_NO_QUOTES.fullmatch(name) and not name.isdecimal():", "if name:", COMPLETION),
    _put("which keys are needed", "formats/event_json_keys.py",
         "yield Key(name, name not in needed,", "yield Key(name, True,", KEYS),
)  # fmt: skip
