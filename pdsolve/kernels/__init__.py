"""The only loops over bonds, and the only compiled code besides the steppers."""
