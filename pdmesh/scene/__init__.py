"""Scenes: plates and bodies as described by an engineer, before there are nodes."""
