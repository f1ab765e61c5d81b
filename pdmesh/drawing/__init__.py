"""Files to scenes: drawings, Python scripts, CAD files, meshes, and models built earlier."""
