"""Bonds on a lattice: one description of a bond, for the plane and for space, summed and advanced by one loop.

The dimension is the length of a tuple and the precision that of an array: both are constants of compilation. Bonds are
in blocks of 64 nodes in any order, whose slots are listed, or in tiles of 16 sites of a box, which share one pattern of
slots and have stiffnesses from what their nodes are.

bond               how far a bond is stretched, and what it pulls with, in some lanes
force_polynomials  the force of a bond without a root and a division
layout             where bonds are in lanes: in blocks and in tiles
sums               the force densities on nodes under a pair law: the loop over bonds, for both layouts
energies           what bonds store and have dissipated under a pair law, on the loop of their forces
families           two passes over families of nodes, for both layouts
fluxes             what diffuses along the bonds of nodes, in tiles
rows               the forces on rows of a moving zone, whose nodes' neighbours lie alike
blocks, tiles      arrays of each layout; how its bonds soften and break
sites              where nodes are in a box
block_bonds        bonds of a list in blocks, and their numbers
tile_bonds         bonds of sites in tiles, and what their bits stand for
operator           pair laws on lattices as operators
family_blocks      families in blocks
family_tiles       families in tiles
flux_operator      what flows along bonds, listed or in tiles
family_operator    laws of families on lattices as operators
marched_bonds      what a march asks of bonds in either layout
march              one sweep a step: forces, loads, prescribed motion, damping, contact and ghosts
"""
