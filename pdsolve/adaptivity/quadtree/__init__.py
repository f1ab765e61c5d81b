"""Cells that split into four where energy is high, and merge behind it.

Adaptive refinement of the thesis (pp. 97-103), after the visibility principle of F. Bobaru, M. Yang, L. F. Alves, S. A.
Silling, E. Askari, J. Xu, Int. J. Numer. Methods Eng. 77 (2009) 852-877: everything within the horizon of a node of
high energy is refined before that horizon shrinks.

    tree                a tree of cells over the nodes of a model, and the model of some of its leaves
    criteria            which leaves split, which merge
    leaf_mapping        origin of the new leaves
    interpolation       initial motion of new nodes, and the change of energy
    incremental_bonds   bonds of changed leaves
    inherited_cracks    broken bonds of new nodes: none heals
    operator            a bond list that also stores how long its nodes have been calm
"""
