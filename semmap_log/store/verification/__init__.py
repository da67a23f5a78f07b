"""Reads all of a log, trusts nothing in it, and reports what is wrong, where, and what it costs.

findings         what can be found, as values; which files make up the log
file_place       where the files are, on a disk or elsewhere, and their bytes
file_heads       what a file's head says
pieces           one segment, byte for byte; one chunk, examined by itself
hash_chain       numbers, times and hashes from chunk to chunk and from segment to segment
keyframe_place   keyframes, compared with the replay by a check that the caller supplies
closing          index, summary and footer, recomputed
verifying        all of it
"""

from semmap_log.store.verification.findings import Finding, Severity, Verification
from semmap_log.store.verification.hash_chain import GoneCommits, ValidCommit
from semmap_log.store.verification.verifying import Progress, Verifier, verify

__all__ = [
    "Finding",
    "GoneCommits",
    "Progress",
    "Severity",
    "ValidCommit",
    "Verification",
    "Verifier",
    "verify",
]
