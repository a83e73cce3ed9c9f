"""Many runs as one: planned, carried out as jobs, gathered with their bands, and compared."""
