"""What neighbours do to a node: the only loops over bonds."""
