"""What an engineer says of a plate, before there are nodes."""
