"""Define the commands of `python -m analysis`, each with its options."""
