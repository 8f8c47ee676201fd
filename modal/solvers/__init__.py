"""Sparse factorisations, block Lanczos, and bounds of a matrix's spectrum."""
