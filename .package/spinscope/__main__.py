"""`python -m spinscope` is the command `spinscope`."""

from spinscope.app.cli import main

main()
