"""Solutions of the equations of motion, with bounds of their errors."""
