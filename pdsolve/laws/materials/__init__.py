"""What stress follows the deformation of a node, a material a file; in space, planes being parts of it."""
