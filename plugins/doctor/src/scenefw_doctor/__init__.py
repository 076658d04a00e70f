"""What a prediction would see of an image, check by check."""
