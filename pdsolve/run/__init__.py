"""A run from a model to its results: preparation, time steps, records and measures."""
