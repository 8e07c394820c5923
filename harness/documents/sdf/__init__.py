"""SDFormat: the meaning of its elements, and the rules of a valid file."""
