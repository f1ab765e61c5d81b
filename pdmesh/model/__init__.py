"""The model shared by the three packages: the grid file, nodes, visibility, and material constants."""
