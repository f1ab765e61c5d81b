"""Peridynamics only where bonds may break; elsewhere a compact lattice of springs with twice the spacing.

The plate is tiled by cells of 2 h. Cells near crack tips and broken bonds are fine: nodes of spacing h with the bonds
of the horizon. All others are springs along their edges and diagonals, with the stiffness of the fine lattice. Fine
bonds that leave the fine cells are clipped: the remaining piece ends on the border, between coarse nodes, and its
stiffness grows as its length shrinks. There is thus a single energy: every linear field is in equilibrium, and momentum
and energy are conserved.

    arrays             what a run changes
    precracks          bonds that pre-cracks cut, surfaces
    irregular_bonds    bonds at edges, pre-cracks and interfaces
    nodes              fine, coarse and far nodes: kinds, masses, springs, initial motion of new ones
    far_cells          cells of 4 h, and how they become four of 2 h
    clipped_bonds      whole bonds, and pieces of others
    bond_breaking      softening and breaking of fine bonds
    forces             forces on all nodes, with kick and drift
    regrid             cells become fine
    march              time steps
    prepare            prepares a model
    node_lists         lists of the current nodes and of their bonds, and their values
    operator           the operator of the current nodes
"""
