"""`fsid` and `python -m fsid`: the command line; Ctrl-C ends it quietly while its modules are read, too."""

from __future__ import annotations

import sys


def main() -> None:
    """Run one command; see `fsid.cli.main`."""
    try:
        from fsid.cli.main import main as run
    except KeyboardInterrupt:
        print("fsid: interrupted", file=sys.stderr)
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
