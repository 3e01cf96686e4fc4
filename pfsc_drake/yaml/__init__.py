"""Typed YAML with messages for people."""
