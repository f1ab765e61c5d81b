"""Cells split into four where energy is, and merge behind it.

Adaptive refinement of the thesis (pp. 97-103), after the visibility principle of F. Bobaru, M. Yang, L. F. Alves, S. A.
Silling, E. Askari, J. Xu, Int. J. Numer. Methods Eng. 77 (2009) 852-877: what is within the horizon of a node of high
energy becomes finer before that horizon becomes smaller.

    cells     a tree of cells over the nodes of a model, and the model of some of its leaves
    marks     which leaves split, which merge
    motion    what new nodes begin with, and what energy that makes
    cracks    which bonds of new nodes are broken: none heals
    leaves    the operator: a list of bonds that remembers how calm its nodes are
"""
