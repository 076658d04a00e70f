"""What a run shows: tables, figures, galleries and the page with all of them."""
