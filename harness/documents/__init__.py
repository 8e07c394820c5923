"""Files as text, XML elements and numbers, each with its bytes and its line."""
