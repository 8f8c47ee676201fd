"""Solve sparse equations by factors or multigrid, and find parts of a spectrum."""
