"""`python -m fsid`: the command line."""

from fsid.cli.main import main

main()
