"""From a discrepancy to its cause: samples, hypotheses, fits, and the record of them."""
