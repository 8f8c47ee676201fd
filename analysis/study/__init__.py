"""The whole study: tables, figures and targets over all its cases, and one page of them."""
