"""Make tables, figures, targets and the page of a study from the results of its cases."""
