"""Pages of the site that are made of the code: keys, commands, the library's door, the gallery."""
