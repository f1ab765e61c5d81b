"""Bonds: what a scheme makes of a model, statistics of them, and how they break at rest."""
