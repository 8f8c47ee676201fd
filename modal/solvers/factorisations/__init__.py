"""Hold one factorisation a module; `modal.solvers.factor` finds each by its `FACTORISATION`."""
