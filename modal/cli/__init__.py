"""The command line: what each command of `python -m modal` prints and writes."""
