"""Coverage-guided fuzzing of this project's parsers."""
