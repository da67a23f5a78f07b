"""A door as a hidden Markov chain: its passes, the rates that explain what was seen, forgetting.

`scan` multiplies, `chain` weighs, `nodes` are the evidence as a chain takes it, `rates` learns, and
`forgetting` is what the rates do to a belief.
"""
