"""`crosscheck new`: a folder to begin from."""
