"""Peridynamics only where bonds may break; a compact lattice of bonds, of twice the spacing, everywhere else.

The plate is tiled by cells of 2 h. Those near crack tips and broken bonds are fine: nodes of spacing h with the bonds
of the horizon. All others are springs along their edges and diagonals, whose stiffness is that of the fine lattice.
Fine bonds that leave the fine cells are clipped: what is left of one ends on the border, between coarse nodes, and is
as much stiffer as it is shorter. So there is one energy: any linear field is at rest, momentum and energy are
conserved.

    lattice   numbering of both lattices and of the cells
    family    springs of one node, fine and coarse, and where bonds cross from cell to cell
    arrays    what a run changes
    precracks bonds that pre-cracks cut, surfaces
    rows      vector code: forces on 16 nodes
    nodes     which nodes are free, on the border, idle; their masses; what new ones begin with
    clip      bonds that are whole, and pieces of others
    regrid    cells become fine
    march     steps
    system    a model, prepared
"""
