"""The hybrid method in space: bonds of a cubic lattice where they may break, springs of cells of 2 h elsewhere.

A cell of 2 h that is not fine has springs along its edges, the diagonals of its faces and its body diagonals. Fine
bonds are those of `pdsolve.lattice.tiles`, with the bits of bonds that lie whole in fine cells; the springs
are a second lattice under the same kernel. The remaining parts of clipped bonds are pieces, in groups of eight.

    layout            arrays of a body, and which of its nodes are near cells
    materials         stiffnesses and limits of several materials
    arrangement       kinds of nodes, bits and pieces that follow from the cells
    coarse_springs    constants of the springs, and the lattice of those that there are
    clipped_pieces    compiled sum of the forces of eight pieces
    pieces            forces and energies of clipped bonds
    swelling          what strains of heat or a solvent do to nodes and to places between coarse ones
    zone              which cells are fine at the start, and which become fine
    march             time steps, some in one call of a kernel
    engine            nodes in motion, and what cells that become fine change of them
    operator          the operator of the current nodes
    prepare           prepares a model
"""
