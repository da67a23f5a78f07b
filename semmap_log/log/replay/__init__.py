"""Log + fold + a moment -> a state: the door map from keyframes, and a user's projections.

`replay` returns the door map or a projection's state, `live_fold` a state after each look at the
log; `running` is what both advance, and `state` keeps it in a checkpoint. `keyframes` converts the
door map to bytes and back: the log stores them and does not know their content. `care` supplies the
state from which they are written, and the check that examines them.
"""
