"""`python -m app` is `spinscope`."""

from .cli import main

main()
