"""Solutions of the equations of motion, with error bounds."""
