"""Hold physics models against their equations, to nine digits, in every engine that runs them."""
