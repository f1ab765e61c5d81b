"""Peridynamics near edges, notches and cracks, stencils of the same horizon on every second node elsewhere."""
