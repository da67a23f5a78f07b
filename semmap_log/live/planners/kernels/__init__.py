"""Kernels of OPRS, reached by their message passer: facts for them, answers to their questions."""
