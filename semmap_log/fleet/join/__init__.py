"""Several robots' logs of one building as one log to read.

`joining_logs` is the entry point. `joined_logs` reads the definition and opens the logs that it
names, `door_plan` decides which doors are one, `event_translation` translates each event, and
`join_building` finds where the joined history begins and writes the view with the ordinary writer.
"""
