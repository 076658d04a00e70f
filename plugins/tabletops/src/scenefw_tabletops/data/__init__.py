"""Views and maps of table-tops, and batches of them."""
