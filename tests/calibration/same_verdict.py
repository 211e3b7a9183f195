"""How many grasps of two runs have the same verdict? `python tests/calibration/same_verdict.py A B "change" OUT.json`

Adds a line to OUT.json, or replaces the line of the same change.
"""

import csv
import json
import sys
from pathlib import Path


def main():
    a, b, change, out = sys.argv[1:5]
    runs = []
    for run in (a, b):
        with (Path(run) / "trials.csv").open() as file:
            runs.append({(r["object"], r["grasp"]): r["held"] for r in csv.DictReader(file)})
    common = sorted(runs[0].keys() & runs[1].keys())
    same = sum(runs[0][k] == runs[1][k] for k in common)
    path = Path(out)
    lines = json.loads(path.read_text()) if path.exists() else []
    lines = [line for line in lines if line["change"] != change]
    lines.append({"change": change, "n": len(common), "same": same})
    path.write_text(json.dumps(lines, indent=1) + "\n")
    print(f"{change}: same verdict for {same} of {len(common)} ({same / len(common):.2%})")


if __name__ == "__main__":
    main()
