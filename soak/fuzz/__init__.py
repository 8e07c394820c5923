"""Coverage-guided fuzzing of this project's own parsers."""
