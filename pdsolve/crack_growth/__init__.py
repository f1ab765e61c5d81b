"""Growth of cracks of particles: criteria, tips and directions."""
