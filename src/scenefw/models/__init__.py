"""Networks: plain torch modules from conditions to shape and instances."""
