"""Laws on lattices, 64 nodes at a time; its numbers of bonds and its arrays are its own."""
