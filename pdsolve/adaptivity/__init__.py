"""Adaptive grids: two lattices coupled by clipped bonds (`hybrid`) or by stencils (`collocation`), and splitting
cells (`quadtree`)."""
