"""Several robots' logs of one building as one log that is read.

`joining_logs` is the way in. `join_definition` is the file, `joined_logs` opens what it names,
`door_plan` says which doors are one, `join_horizon` where its history begins, `event_translation`
what becomes of an event, and `join_building` writes the view with the ordinary writer.
"""
