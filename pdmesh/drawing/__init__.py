"""From files to a scene: drawings, scripts, CAD files, meshes, and models that were built before."""
