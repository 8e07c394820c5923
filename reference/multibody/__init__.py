"""Trees of rigid bodies: what they are, and their equations of motion by recursion."""
