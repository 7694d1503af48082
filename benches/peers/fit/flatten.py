#!/usr/bin/env python3
"""Writes FOLDER/NAME.flat, what the peers read, of every NAME.binary named.

    flatten.py FOLDER TABLE.binary...

A table whose channels are not valid at the same entries is told and left out.
"""

import os
import sys

import merl


def main(folder, tables):
    os.makedirs(folder, exist_ok=True)
    grid = merl.Grid()
    for table in tables:
        name = os.path.splitext(os.path.basename(table))[0]
        flat = os.path.join(folder, f"{name}.flat")
        if not merl.flatten(grid, merl.read(table), flat):
            print(f"{table}: left out, its channels are not valid at the same entries", file=sys.stderr)
            if os.path.exists(flat):
                os.remove(flat)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2:])
