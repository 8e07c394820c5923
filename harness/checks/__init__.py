"""Checks of one model in one engine, from its loading to its verdict."""
