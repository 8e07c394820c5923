"""Diagnosis of discrepancies: samples, hypotheses, fits, and their records."""
