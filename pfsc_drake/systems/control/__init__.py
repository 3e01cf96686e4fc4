"""Systems of a controller: they see what is measured and believed."""
