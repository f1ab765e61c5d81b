"""Bonds on a lattice, in the plane and in space: one description of a bond, its sums, and the march that fuses both.

The dimension is the length of a tuple and the precision that of an array: both are constants of compilation.

bond     how far a bond is stretched, and what it pulls with, in some lanes of a tile
sums     the force densities and energies of tiles under a pair law; how bonds soften and break
march    velocity Verlet with the sums of a tile kept in registers until its nodes have moved
"""
