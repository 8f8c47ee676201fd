"""The commands of `python -m analysis`: options of each beside what it does."""
