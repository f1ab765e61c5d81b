"""Cracks that are grown: where, when and whither."""
