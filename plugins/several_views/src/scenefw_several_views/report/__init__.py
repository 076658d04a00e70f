"""What results of several views look like on the page."""
