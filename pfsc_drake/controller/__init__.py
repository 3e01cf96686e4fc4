"""One controller: tasks, options, assembly."""
