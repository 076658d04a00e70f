"""Objects that keep their ids over the images of a scene."""
