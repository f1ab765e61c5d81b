"""The moving zone of fine cells, in the plane and in space: what both have.

cells                numbering of the nodes and cells of all spacings, kinds of nodes, cells that become fine
start_cells          which cells are whole, and which have some of the nodes
prescribed_motion    nodes whose prescribed motion coarse cells do not have
bond_parts           the parts into which cells divide bonds, and the pieces of bonds outside coarse cells
node_models          models of some of a model's nodes
summary              what a run reports of its zone
refusals             errors of models that zones do not support
tangent              tangent of springs between points that move with nodes
springs              springs of a fine node, and of the compact lattice that is as stiff, in the plane
"""
