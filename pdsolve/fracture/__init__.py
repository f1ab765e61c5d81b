"""Fields, gradients and integrals at cracks, which runs that grow cracks and pictures of results share."""
