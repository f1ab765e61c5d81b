"""What is said of a model or a scene: what it holds, looks like, will cost and is worth."""
