"""Operators: the forces of neighbours on a node. Only these modules loop over bonds."""
