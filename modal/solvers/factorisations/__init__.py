"""One factorisation a module, each found by `modal.solvers.factor` as its `FACTORISATION`."""
