"""The commands of the program that have a room for themselves."""
