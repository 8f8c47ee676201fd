"""Errors, arrays, compiled loops, progress and display, which all other packages of modal use."""
