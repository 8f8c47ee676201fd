"""Closed forms to compare with: the dispersion relation of the FCC crystal."""
