"""Motions with events: modes of contacts, friction and drives, and the transitions between them."""
