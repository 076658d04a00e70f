"""How many objects stand on the table: a plugin of scenefw with a task of its own."""
