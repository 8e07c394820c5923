"""`crosscheck new`: a system folder for a user, from the example or from a model file of theirs."""
