"""Pages for people: report and comparison."""
