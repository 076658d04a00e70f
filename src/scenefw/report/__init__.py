"""What a run shows: tables, figures, galleries and the page that holds them."""
