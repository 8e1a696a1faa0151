"""What commands print: tables, progress, and documents for programs."""
