"""Pure folds of events to states. They know events and values, never a file.

`projection` shows what a user's own looks like. The states here take an `EventBatch` with
`apply(batch)`, in place; the door map's takes batches in any order, with the same result.
"""
