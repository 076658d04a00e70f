"""Named terms of the training loss."""
