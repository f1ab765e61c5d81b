"""The commands of pdpost: a group of them a file, each with `add(commands)` that puts them on the command line."""
