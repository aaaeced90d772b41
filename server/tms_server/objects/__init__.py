"""Objects by tag, products by JAN, intake and the unknown-tag list."""
