"""Laws of forces that are not smooth."""
