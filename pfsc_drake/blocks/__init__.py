"""Components as blocks: ports, states, and expressions of what they put out and remember."""
