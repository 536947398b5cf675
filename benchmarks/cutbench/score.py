#!/usr/bin/env python3
"""Scores result files: a table of errors by case, quantity and code.

score.py RESULT.json... [--markdown]

Ends with 1 when a value is outside of its tolerance, with 2 when a file cannot be used. A case that a file leaves out is told
as '-', and is no failure.
"""

import argparse

from cutbench import read_result, run_main, score


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", nargs="+", metavar="RESULT.json")
    parser.add_argument("--markdown", action="store_true")
    given = parser.parse_args()
    results = [read_result(file) for file in given.results]
    scores = [score(result) for result in results]
    heads = ["case", "quantity", "tolerance", *(f"{result['code']} {result['version']}" for result in results)]
    rows, outside, measured = [], 0, 0
    for same in zip(*scores):
        cells = []
        for _, _, error, tolerance in same:
            failed = error is not None and not error <= tolerance
            outside += failed
            measured += error is not None
            cells.append("-" if error is None else f"{100 * error:.2g} %" + (" fails" if failed else ""))
        name, quantity, _, tolerance = same[0]
        rows.append([name, quantity, f"{100 * tolerance:g} %", *cells])
    if given.markdown:
        print("\n".join("| " + " | ".join(row) + " |" for row in [heads, ["---"] * len(heads), *rows]))
    else:
        widths = [max(len(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
        print("\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in [heads, *rows]))
    print(f"\n{measured - outside} of {measured} values within their tolerance")
    return 1 if outside else 0


if __name__ == "__main__":
    run_main(main)
