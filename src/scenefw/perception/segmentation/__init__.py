"""Which pixels show one object each, and where objects end."""
