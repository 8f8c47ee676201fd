"""Errors, arrays, compiled loops, progress and display, on which all other rooms stand."""
