"""Models of table-tops from files of meshes."""
