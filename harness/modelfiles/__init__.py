"""Model files and system folders on disk: readers, numbers with their places, edits, bindings."""
