"""What comes out: tables, fields, folders of results, comparison with published numbers."""
