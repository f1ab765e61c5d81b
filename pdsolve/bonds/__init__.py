"""Bonds made by a scheme, their statistics, and how they break at rest."""
