"""`python -m wbplan` is `wbplan`."""

from __future__ import annotations

import sys

from wbplan.cli.commands import main

if __name__ == "__main__":
    sys.exit(main())
