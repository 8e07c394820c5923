"""Trees of bodies: their equations against others that share nothing with them."""
