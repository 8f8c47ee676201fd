"""Run time against error: each module has run(quick) -> rows and prints a Markdown table."""
