"""Many runs of one scenario: what varies, running it on all cores, table, pictures and page."""
