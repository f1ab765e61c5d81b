"""Quantities computed from results: fields, cracks, energies, forces, costs."""
