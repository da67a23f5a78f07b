"""A door as a hidden Markov chain.

`looks` are the evidence as a chain takes it, and how well `hour_modes`, the ways in which a door is
used in an hour, explain them. `matrix_scan` computes the chain, by products of many matrices.
`regimes` are ways in which doors behave. `first_passages` estimates waiting times.
"""
