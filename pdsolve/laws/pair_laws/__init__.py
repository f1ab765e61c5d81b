"""Laws of bonds that know nothing of others, one a file."""
