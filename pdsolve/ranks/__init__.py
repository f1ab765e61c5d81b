"""One run on many ranks: each has a slab of the nodes, and ghosts of the others' nodes beside it."""
