"""From a scene to its nodes, and whether they are the plate that was drawn."""
