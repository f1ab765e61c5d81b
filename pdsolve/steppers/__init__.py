"""Time integration and static solution methods."""
