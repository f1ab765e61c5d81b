"""Explicit bond-based peridynamics with fracture: a node grid in, an SQLite database of results out."""
