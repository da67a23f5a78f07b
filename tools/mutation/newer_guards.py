"""What keeps a later version's events from being lost, and strangers' zip files within bounds."""

from __future__ import annotations

from mutation.mutant import Mutant

LOG = "semmap_log/log/"
CARE = "tests/newer/test_care.py"
PYTHON = "tests/newer/test_python.py"
VERBS = "tests/newer/test_verbs.py"
VERSIONS = "tests/newer/test_versions.py"
ZIPPED = "tests/log/test_zipped.py"
ELSEWHERE = "tests/log/test_elsewhere.py"


def _without(name: str, file: str, snippet: str, *tests: str, put: str = "pass") -> Mutant:
    return Mutant(name, LOG + file, snippet, put, tests)


NEWER = (
    _without("an answer that an unknown event may touch", "reading/reader.py",
             "if newer.reach(limit):", PYTHON, put="if False:"),
    _without("an answer of before an unknown event", "reading/newer_events.py",
             "(limit is None or self.first <= limit)", PYTHON, put="True"),
    _without("what a newer version wrote and is left out is said", "reading/reader.py",
             "warnings.warn(newer.warning(self.folder), stacklevel=3)", PYTHON),
    _without("a commit with what may change others", "reading/following.py",
             "if not with_newer and _may_change_others(batch, source):", PYTHON, put="if False:"),
    _without("a kind without a mark", "reading/newer_events.py",
             "if kind not in newer.harmless:", PYTHON, put="if False:"),
    _without("checkpoints behind unknown events", "../folding/position.py",
             "reader.check_known(limit)", PYTHON),
    _without("batches of what is taken back, too", "../door_log.py",
             "known = reader.retractions()", PYTHON, put="known = Retractions()"),
    _without("what a later version put at the head", "writing/recovery.py",
             "segment.path.name, segment.full_header)", CARE,
             put="segment.path.name, segment.header)"),
    _without("the head of the next segment", "writing/segment_chain.py",
             "older, last.full_header, last", CARE, put="older, last.header, last"),
    _without("the head of a compacted segment", "header.py",
             "newer=Newer.all_of(header.newer for header in headers),", CARE, put=""),
    _without("entries of a later version", "header.py",
             "**dict(self.others),", CARE, put=""),
    _without("the minor version of a copy", "header.py",
             "minor=max(self.minor, FORMAT_MINOR)", CARE, put="minor=FORMAT_MINOR"),
    _without("no recovery of what only a later version can take over", "salvage/survey.py",
             "if is_beyond_us and found.of(Severity.DAMAGE):", CARE, put="if False:"),
    _without("no new number for an unknown event", "salvage/survey.py",
             " or (verifier.newer and taken.rewriter.has_moved)", CARE, put=""),
    _without("no keyframe is folded behind unknown events", "verification/run.py",
             "self._keyframes.give_up()", CARE),
    _without("no known Schema is taken for a later one", "verification/walk.py",
             " or not is_later_kind(number)", CARE, put=""),
    _without("another major version is no damage", "verification/files.py",
             "    except OtherVersionError as error:\n        raise (NewerLogError if",
             VERBS, put="    except ZeroDivisionError as error:\n        raise (NewerLogError if"),
    _without("a zip is not written to", "writing/opening.py", "refuse_zip(path)", ZIPPED),
    _without("a zip is not compacted", "compaction/run.py",
             "    refuse_zip(path)\n    closed", ZIPPED, put="    closed"),
    _without("names that lead out of a zip", "zipped.py",
             "if not _stays_inside(one.filename):", ZIPPED, put="if False:"),
    _without("links in a zip", "zipped.py",
             "if kind not in (0, stat.S_IFREG):", ZIPPED, put="if False:"),
    _without("two files of one name in a zip", "zipped.py",
             "elif one.filename in names:", ZIPPED, put="elif False:"),
    _without("how much a zip says that it holds", "zipped.py", "if size > most:", ZIPPED,
             put="if False:"),
    _without("how much a zip does hold", "zipped.py", "if done > most:", ZIPPED, put="if False:"),
    _without("how long a zip's list of files is", "zipped.py",
             "if len(data) > MOST_LIST_BYTES:", ZIPPED, put="if False:"),
    _without("room for what is unpacked", "zipped.py", "if size > free:", ZIPPED, put="if False:"),
    _without("what is unpacked goes", "zipped.py",
             "        except BaseException:\n            self._folder.cleanup()", ZIPPED,
             put="        except ZeroDivisionError:\n            self._folder.cleanup()"),
    _without("no log is begun where writing lacks something", "writing/opening.py",
             "    check_can_write(path)\n    with", ELSEWHERE, put="    with"),
    _without("no log is held where writing lacks something", "folder.py",
             "        check_can_write(path)\n", ELSEWHERE, put=""),
)  # fmt: skip
