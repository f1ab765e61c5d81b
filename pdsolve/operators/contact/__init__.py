"""Contact of bodies and of crack faces: search, penalty forces, friction."""
