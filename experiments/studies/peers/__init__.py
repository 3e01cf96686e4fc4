"""Path following beside what a user would take instead."""
