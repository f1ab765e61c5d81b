"""The commands of pdpost, one group a file; the function `add(commands)` of each puts them on the command line."""
