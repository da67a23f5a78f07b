"""A door as a hidden Markov chain.

`nodes` are the evidence as a chain takes it, `markov_chain` weighs, with `matrix_scan`'s products;
`regimes` are ways in which doors go on. `rates` learns how often a door changes, from what is to be
expected `between_looks`, for `first_passages`, which tell how long one waits.
"""
