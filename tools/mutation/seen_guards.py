"""What a person sees: times that look alike, terminals too narrow, letters that no font has."""

from __future__ import annotations

from mutation.mutant import mutants_in

MOMENTS = "tests/test_moments.py"
TABLES = "tests/views/test_tables.py"
COLUMNS = "tests/views/test_columns.py"
DAY_CHART = "tests/views/test_day_chart.py"
TAIL = "tests/cli/test_tail.py"
WEEKS = "tests/views/plots/test_weeks.py"
LABELS = "tests/test_door_labels.py"
TICKS = "tests/views/report/test_ticks.py"
BROWSER = "tests/views/report/test_in_browser.py"
LANES = "tests/views/plots/test_lanes.py"

_seen = mutants_in("semmap_log/", "seen: ")

SEEN = (
    _seen("a time that comes twice has its offset", "moments.py",
          '(_offset_text(local) if _comes_twice(local) else "")', '""', MOMENTS, TABLES),
    _seen("other times have none", "moments.py",
          "local.replace(fold=0).utcoffset() != local.replace(fold=1).utcoffset()", "True",
          MOMENTS),
    _seen("the page tells apart the times that come twice", "views/report/page/calendar.js",
          "shown - ahead < till).length > 1", "shown - ahead < till).length > 2", TICKS),
    _seen("the page's last changes, too", "views/report/page/data.js",
          "(buildingClock.comesTwice(data.begin + t) ?", "(false ?", BROWSER),
    _seen("cells stand below each other before any is cut", "views/columns.py",
          "if spare < 0:", "if spare < -8:", COLUMNS),
    _seen("a wide text takes no room that another column needs", "views/columns.py",
          "width=widths.get(place, column.width),", "width=column.width,", COLUMNS),
    _seen("a value stays whole below its name", "views/beside.py",
          "all(cell_len(word) <= room for word in text.split())", "True", COLUMNS),
    _seen("a day of 47 half hours is drawn", "views/day_chart.py",
          "-len(shares) % every", "0", DAY_CHART),
    _seen("tail's lines fit the terminal", "views/event_lines.py",
          "if cell_len(longer.rstrip()) <= width:", "if True:", TAIL),
    _seen("wide letters count two columns", "views/event_lines.py",
          "(width - cell_len(text))", "(width - len(text))", TAIL),
    _seen("who sees nothing is told", "cli/tail.py",
          "if not (shown or follow or last == 0):", "if False:", TAIL),
    _seen("a plot calls a door by its number where it lacks letters", "views/plots/sdk.py",
          "return any(font.get_char_index(ord(character)) for font in _fonts())", "return True",
          WEEKS, LANES),
    _seen("of hundreds of typical weeks the first are drawn", "views/plots/weeks.py",
          "weeks[:MOST_PANELS]", "weeks[:]", WEEKS),
    _seen("no label could be another door's", "views/report/page/labels.js",
          "gapTo(box, other) >= most", "true", BROWSER),
    _seen("a door out of sight has no label", "views/report/page/plan.js",
          "const inside = x >= 0 && y >= 0 &&", "const inside = x >= -30 && y >= -30 &&", BROWSER),
    _seen("a name that several bear has its level", "door_labels.py",
          "if bearers[name] == 1:", "if True:", LABELS),
    _seen("and the id where even that is another's", "door_labels.py",
          "elif on_level[name, level] == 1:", "elif True:", LABELS),
)  # fmt: skip
