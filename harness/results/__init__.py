"""Issues, causes and next steps: what terminal, page, pytest and code hosts report."""
