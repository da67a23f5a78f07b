"""Pure folds of events to states. They know events and values, never a file.

`projection` says what a user's own looks like. The states here take an `EventBatch` in by
`apply(batch)`, in place; the door map's takes batches in any order: the result is the same.
"""
