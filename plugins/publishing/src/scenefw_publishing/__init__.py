"""What a document shows of the weights that ship: its table of figures and its pictures."""
