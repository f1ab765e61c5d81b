"""Pictures, histories and crack figures from a database of peridynamic results."""
