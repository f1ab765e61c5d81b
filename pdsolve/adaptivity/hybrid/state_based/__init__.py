"""The hybrid method of linear peridynamic solids in the plane: any Poisson's ratio, bilinear cells of 2 h elsewhere.

A site is a fine node in or beside fine cells. Its dilatation and shear are sums over the pieces of bonds in the fine
zone, each piece with a weight c. Forces are the slope of one energy, so that momentum and energy hold.

    plate            the fine nodes of a whole plate, and their bonds
    arrangement      kinds of nodes, and pieces of bonds, that follow from the cells
    border_weights   weights c of the pieces that end on the border
    families         sums of sites over pieces
    bilinear_cells   forces and energies of coarse cells
    tangent          derivatives of the forces
    operator         the operator of the current nodes
    prepare          prepares a model
"""
