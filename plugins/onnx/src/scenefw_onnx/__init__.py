"""Networks as ONNX, and what labels views with them."""
