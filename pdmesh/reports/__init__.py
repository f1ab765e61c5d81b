"""Reports on a model or a scene: contents, pictures, cost and accuracy."""
