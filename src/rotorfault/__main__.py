"""``python -m rotorfault``: the command line."""

from rotorfault.cli.main import main

main()
