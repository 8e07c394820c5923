"""Issues, causes and next steps for the terminal, the report, pytest and code hosts."""
