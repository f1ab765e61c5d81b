"""Bonds on a lattice: one description of a bond, for the plane and for space, and sums over the bonds of nodes.

The dimension is the length of a tuple and the precision that of an array: both are constants of compilation.

bond      how far a bond is stretched, and what it pulls with, in some lanes
layout    where bonds are in lanes: in blocks and in tiles
sums      the force densities on nodes under a pair law: the loop over bonds, for both layouts
blocks    arrays of blocks; how their bonds soften and break; their energies
tiles     the same of tiles
families  two passes over families of nodes, for both layouts
fluxes    what diffuses along the bonds of nodes, in tiles
rows      the forces on rows of a moving zone, whose nodes' neighbours lie alike
"""
