"""Make a catalogue folder of human-made furniture from Debian's package `sweethome3d-furniture`.

    python scripts/make_furniture_catalogue.py furniture/
    python scripts/make_furniture_catalogue.py furniture/ --source sweethome3d-furniture_1.8-1_all.deb --ours

Without --source the installed package is taken, or downloaded by apt. Models whose licence does not let them be passed
on are left out and listed. `kpred database build furniture/ -o furniture.kpred` makes a database of it.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from kpred.datasets.sweethome3d.catalogue import make_catalogue
from kpred.datasets.sweethome3d.categories import OURS
from kpred.datasets.sweethome3d.package import find_libraries


def main() -> None:
    """Write the catalogue and print what is in it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of the catalogue")
    parser.add_argument("--source", type=Path, help="package (.deb), library (.sh3f) or folder of libraries")
    parser.add_argument("--ours", action="store_true", help="chairs, tables and cabinets alone")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="kpred-") as scratch:
        libraries = find_libraries(options.source, Path(scratch))
        report = make_catalogue(libraries, options.folder, OURS if options.ours else None)
    for category, count in report.counts.items():
        print(f"{category:20} {count}")
    print(", ".join(f"{count} {name}" for name, count in report.licences.items()))
    for one in report.left_out:
        print(f"left out: {one.key}: {one.reason}")


if __name__ == "__main__":
    main()
