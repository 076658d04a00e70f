"""Changes of predicted scenes by hand."""
