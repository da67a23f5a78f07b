"""The log on disk: a folder of MCAP segments. The only room that knows MCAP.

It knows bytes, commits and columns of events, and no door map: what stands in keyframes is handed
in (`writing/keyframe_source`, `verification/keyframe_place`). What is read may lie elsewhere than
on a disk (`reading/segment_store`, `verification/file_place`); what is written lies in a folder.

Here lies what all of it shares: `form` says what lies where; `records`, `chunks` and `commits` make
the bytes, `pages` takes them apart; `segment` is a file being written, `folder` where it lies,
`closed_mark` how far all of it reached. The rooms inside:

    reading/        segments and the log as a whole, read
    compaction/     closed segments made small
    writing/        the one writer
    verification/   all of it examined, believing nothing, not even what `reading` does
    salvage/        a damaged log made whole again
    copying/        a log copied while it is written
"""
