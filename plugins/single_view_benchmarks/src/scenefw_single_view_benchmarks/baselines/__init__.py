"""Networks that table 5.1 compares with: fully convolutional, SSCNet."""
