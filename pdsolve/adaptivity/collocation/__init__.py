"""Peridynamics near edges, notches and cracks; elsewhere stencils of the same horizon on every second node."""
