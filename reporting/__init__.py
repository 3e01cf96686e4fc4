"""Figures, pages, folders, tables and the terminal."""
