"""Comparison of two model files of one mechanism, without equations."""
