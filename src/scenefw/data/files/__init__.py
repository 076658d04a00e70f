"""Files that come from outside or go there: images, recordings, maps, labels."""
