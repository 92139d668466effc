"""Fast numba functions over trusted arrays. Each writes only into its first argument, if into any, and says so."""

from .. import compilation as compilation  # where the compiled ones are kept; before any is defined
