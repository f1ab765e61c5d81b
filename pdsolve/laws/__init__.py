"""What one bond does: its stiffness and when it breaks. A law never sees a loop."""
