"""The log on disk: a folder of MCAP segments. The only room that knows MCAP.

Here lies what all of it shares: `form` says what lies where; `records`, `chunks` and `commits` make
the bytes, `pages` takes them apart; `segment` is a file being written, `folder` where it lies,
`closed_mark` how far all of it reached. The rooms inside:

    reading/        segments and the log as a whole, read
    compaction/     closed segments made small
    writing/        the one writer
    verification/   all of it examined, believing nothing, not even what `reading` does
    salvage/        a damaged log made whole again
"""
