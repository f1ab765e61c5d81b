"""Laws on lattices, 64 nodes at a time; bond numbers and arrays are internal."""
