"""Write a made-up folder in Scan2CAD's layout, to try a table before the data sets are there.

python scripts/make_scan2cad_layout.py -o made-up --scenes 20
kpred evaluate table scan2cad made-up -o dry-run.json
"""

from __future__ import annotations

import argparse
from pathlib import Path

from made_up_scan2cad import write_made_up_scan2cad


def main() -> None:
    """Parse the arguments, write, and say what there is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    made = write_made_up_scan2cad(arguments.output, arguments.scenes, arguments.seed)
    print(f"{arguments.output}: {made}")


if __name__ == "__main__":
    main()
