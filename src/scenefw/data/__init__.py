"""From files and scenes to samples and batches."""
