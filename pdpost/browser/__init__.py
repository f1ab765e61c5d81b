"""A run in the browser: the page, its data, a server on the loopback address, and one file that works offline."""
