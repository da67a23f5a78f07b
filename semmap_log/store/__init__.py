"""The log on disk: a folder of MCAP segments. The only package that knows MCAP.

It knows bytes, commits and columns of events, but no door map: callers supply the content of
keyframes (`writing/writer`, `verification/keyframe_place`). A log can be read from other places
than a disk (`reading/segment_set`, `verification/file_place`); it is always written to a folder.

The modules here are shared: `form` states what lies where; `records`, `chunks` and `commit_records`
make the bytes, `pages` takes them apart; `segment` is a file being written, `folder` its place,
`closed_mark` how far all of it reached. The packages inside:

    reading/        reads segments, and the log as a whole
    compaction/     makes closed segments small
    writing/        the one writer
    verification/   examines all of it, and trusts nothing, not even what `reading` does
    salvage/        makes a damaged log whole again
    copying/        copies a log while it is written
    trimming/       takes records out of closed segments
"""
