"""Provide errors, arrays, compiled loops, progress and display to all other packages of modal."""
