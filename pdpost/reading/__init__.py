"""Reading: frames and tables of a database of results, and the grid file in it."""
