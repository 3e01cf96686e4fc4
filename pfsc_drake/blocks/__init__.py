"""Components as blocks: ports, states, expressions of outputs and updates."""
