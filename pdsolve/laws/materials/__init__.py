"""Stress responses of materials, one a file, in three dimensions with plane cases included."""
