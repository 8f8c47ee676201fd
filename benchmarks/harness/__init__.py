"""What every benchmark stands on: measured tasks, tables, diagrams, and the programs compared."""
