"""Drake LeafSystems: ports, state, events."""
