"""Words by which the harness tells what a file is."""

STILL = "it has no joint that moves"
REFUSED = "can't load it"
