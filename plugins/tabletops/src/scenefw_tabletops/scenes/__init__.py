"""Where models lie, and how the table is lit."""
