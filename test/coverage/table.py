"""Prints gcovr's summary as a table of lines and branches, and says whether the required shares are reached."""
import json
import sys


def percent(covered, total):
    return 100.0 * covered / total if total else 100.0


def row(name, data):
    cells = [f"{data[f'{kind}_covered']:7}/{data[f'{kind}_total']:<5}{percent(data[f'{kind}_covered'], data[f'{kind}_total']):7.1f}%"
             for kind in ("line", "branch")]
    return f"{name:36}" + "".join(cells)


def main(path, line_share, branch_share):
    with open(path, encoding="ascii") as file:
        summary = json.load(file)
    print(f"{'file':36}{'lines':>20}{'branches':>20}".rstrip())
    for data in summary["files"]:
        print(row(data["filename"], data))
    print(row("all", summary))
    lines = percent(summary["line_covered"], summary["line_total"])
    branches = percent(summary["branch_covered"], summary["branch_total"])
    passed = summary["line_total"] > 0 and lines >= float(line_share) and branches >= float(branch_share)
    print(f"{lines:.1f} % of the lines ({line_share} % required), {branches:.1f} % of the branches ({branch_share} % required): "
          f"{'PASS' if passed else 'FAIL'}")


if __name__ == "__main__":
    main(*sys.argv[1:])
