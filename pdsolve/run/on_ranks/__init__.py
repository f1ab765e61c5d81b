"""A motion on many ranks: each has the system, the state and the records of its own nodes, and rank 0 writes them."""
