"""What drawn scenes look like on the page."""
