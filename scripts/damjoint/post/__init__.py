"""What comes out: tables, verdict, fields, pictures, comparison with published numbers."""
