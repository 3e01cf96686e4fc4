"""Margins of linear sampled loops: modes, gain and phase that are borne, delay that is borne."""
