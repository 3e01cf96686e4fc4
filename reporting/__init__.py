"""What results look like: figures, pages, folders, tables and the terminal."""
