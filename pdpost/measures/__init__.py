"""What is computed of results: fields, cracks, energies, forces, costs."""
