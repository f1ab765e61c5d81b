"""Nodes that follow a crack: two lattices coupled by clipped bonds (`hybrid`) or by stencils (`collocation`), cells
that split and merge (`quadtree`)."""
