"""Laws of forces that are not smooth, on a tree's own mass matrix, forces and Jacobians."""
