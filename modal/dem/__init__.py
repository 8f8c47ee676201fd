"""Move spheres: contact forces with history, lists of contacts, time steps."""
