"""Whether tests notice when the code is wrong."""
