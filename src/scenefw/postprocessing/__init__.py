"""From predicted volumes to objects: instances, surfaces, confidence."""
