"""Agreement with labels by category, with intervals over objects:

    python tests/calibration/by_category.py RUN docs/validation/agreement_unseen.json

RUN is a run directory over labelled grasp files whose names start with their category.
"""

import csv
import json
import random
import sys
from collections import defaultdict
from pathlib import Path


def balanced(counts):
    tp, fp, fn, tn = counts
    if tp + fn == 0 or fp + tn == 0:
        return None
    return (tp / (tp + fn) + tn / (tn + fp)) / 2


def interval(objects, draws=2000, seed=0):
    """95 % bootstrap interval of the pooled balanced accuracy, whole objects drawn."""
    rng = random.Random(seed)
    values = []
    for _ in range(draws):
        drawn = [rng.choice(objects) for _ in objects]
        value = balanced([sum(c) for c in zip(*drawn)])
        if value is not None:
            values.append(value)
    values.sort()
    return [values[int(0.025 * len(values))], values[int(0.975 * len(values))]] if values else None


def main():
    run, out = map(Path, sys.argv[1:3])
    objects = defaultdict(lambda: [0, 0, 0, 0])
    for row in csv.DictReader((run / "trials.csv").open()):
        index = {("1", "1"): 0, ("1", "0"): 1, ("0", "1"): 2, ("0", "0"): 3}[row["held"], row["label"]]
        objects[row["object"]][index] += 1
    groups = defaultdict(list)
    for name, counts in objects.items():
        groups[name.split("_")[0]].append(counts)
    rows = []
    for name, members in sorted(groups.items()):
        counts = [sum(c) for c in zip(*members)]
        rows.append({"category": name, "objects": len(members), "counts": counts, "balanced_accuracy": balanced(counts), "ci95": interval(members)})
    summary = json.loads((run / "summary.json").read_text())
    report = {"agreement": summary["agreement"], "outcomes": summary["physics"]["outcomes"], "categories": rows}
    out.write_text(json.dumps(report, indent=1) + "\n")
    for row in rows:
        print(row["category"], row["objects"], row["counts"], row["balanced_accuracy"], row["ci95"])


if __name__ == "__main__":
    main()
