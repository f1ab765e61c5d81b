"""What is drawn. A figure is returned, never shown."""
