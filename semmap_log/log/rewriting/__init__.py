"""What logs hold, told again as another log: of several robots together, or under other names.

`log_anew` is the new log, `new_numbers` what events are called in it. What becomes of an event is
for whoever retells to say: `fleet.join`, `pseudonyms`.
"""
