"""Bonds on a lattice: one description of a bond, for the plane and for space, and sums over the bonds of nodes.

The dimension is the length of a tuple and the precision that of an array: both are constants of compilation.

bond      how far a bond is stretched, and what it pulls with, in some lanes of a tile
families  two passes over families of nodes, in blocks and in tiles
fluxes    what diffuses along the bonds of nodes, in tiles
rows      the forces on rows of a moving zone, whose nodes' neighbours lie alike
sums      the force densities and energies of tiles under a pair law; how bonds soften and break
"""
