"""The engine protocol, the adapters, and code that they share."""
