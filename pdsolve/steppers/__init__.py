"""From one time to the next."""
