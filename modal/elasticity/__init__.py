"""Elastic moduli of a packing: its stiffness tensor, and the waves that follow from it."""
