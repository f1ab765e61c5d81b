"""Bonds on a cubic lattice, 16 sites at a time; sites of rows and of plates too, of which diffusion has bonds."""
