"""Reads all of a log, believes nothing of it, and says what is wrong, where, and what it costs.

findings         what can be found, as values
file_place       where the files lie: a disk, or another place
file_bytes       a file's bytes, whatever its place gives
file_heads       what a file's head says
folder_files     which files make up the log, which are missing, foreign, there twice
walk             one segment, byte for byte; after damage it continues at the next whole chunk
pieces           one chunk, examined by itself
hash_chain       numbers, times and hashes from chunk to chunk and from segment to segment
keyframe_place   keyframes: compared with the replay by what is handed in
closing          index, summary and footer, recomputed
verifying        all of it
"""

from semmap_log.store.verification.findings import Finding, Severity, Verification
from semmap_log.store.verification.hash_chain import GoneCommits, WholeCommit
from semmap_log.store.verification.verifying import Progress, Verifier, verify

__all__ = [
    "Finding",
    "GoneCommits",
    "Progress",
    "Severity",
    "Verification",
    "Verifier",
    "WholeCommit",
    "verify",
]
