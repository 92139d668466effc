"""Fast numba functions over trusted arrays. Each writes only into its first argument, if into any, and says so."""
