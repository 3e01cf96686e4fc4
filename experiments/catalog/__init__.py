"""Shipped scenarios, and scenario files of a user's own."""
