"""Figures, tables and page of an identification."""
