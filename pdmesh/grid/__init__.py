"""Scenes to nodes, and checks that the nodes represent the plate that was drawn."""
