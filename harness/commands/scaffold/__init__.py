"""`crosscheck new`: create a folder with a commented system."""
