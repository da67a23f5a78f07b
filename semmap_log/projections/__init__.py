"""Pure folds of events to states. They know events and values, never a file.

A projection is a class with `apply(batch)`, which takes an `EventBatch` and changes the state in
place; events may come in any order and any number of batches: the result is the same.
"""
