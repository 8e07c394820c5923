"""Two model files of one mechanism held against each other, without equations."""
