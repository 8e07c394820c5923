"""The commands of `crosscheck`, one module each: `add` declares its arguments, `main` runs it."""
