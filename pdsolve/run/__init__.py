"""A run: what is prepared, marched, recorded and measured, from a model to its results."""
