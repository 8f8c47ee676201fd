"""Eigenmodes of a packing: lists, exact counts, zero modes, density of states, observables."""
