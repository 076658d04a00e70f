"""What results of labelling look like on the page."""
