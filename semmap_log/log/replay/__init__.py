"""Log + fold + a moment -> a state: the door map from keyframes, and projections of one's own.

`replay` gives the door map, `fold` a projection's state, `live_fold` one after each look at the
log; `running` is what both advance, and `checkpoint` keeps it in a file. `keyframes` makes bytes of
the door map and back: the log stores them and does not know what they hold. It is handed
`written_state` to write them, and `keyframe_check` to examine them (`care`).
"""
