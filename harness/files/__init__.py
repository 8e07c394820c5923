"""A system folder on disk: sidecars, expressions, bindings, and where each number stands."""
