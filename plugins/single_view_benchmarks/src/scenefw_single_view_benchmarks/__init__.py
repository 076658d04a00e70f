"""How well predictions from one view do, on household things, real images and under gravity."""
