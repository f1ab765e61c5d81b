"""Bonds on a cubic lattice, 16 sites at a time."""
