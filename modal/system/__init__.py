"""Stiffness and mass of a packing: springs, matrices, products without a matrix, static loads."""
