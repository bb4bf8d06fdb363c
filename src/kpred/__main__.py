"""``python -m kpred`` is the command ``kpred``."""

import sys

from kpred.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
