"""A door as a hidden Markov chain.

`looks` are the evidence as a chain takes it, `markov_chain` weighs, with `matrix_scan`'s products;
`regimes` are ways in which doors go on. For `first_passages`, which tell how long one waits,
`hour_looks` holds what was looked at against `hour_modes`, how a door is used in an hour.
"""
