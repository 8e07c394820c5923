"""Reference equations: declared, derived, linearized and solved, independently of any engine."""
