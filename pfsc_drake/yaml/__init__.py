"""Typed YAML: rules, reader, JSON schema."""
