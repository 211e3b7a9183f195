"""Fits the constants of the preset `acronym` that ACRONYM's authors never published.

    python tests/calibration/calibrate.py --data ../shared/acronym/seen --out docs/validation/calibration.json

Tries every combination of the grid on the same grasps of `seen` (never of `unseen`) and keeps the one
with the best sum of the pooled balanced accuracy and its mean over objects. Runs resume: what the
output file holds already is not tried again.
"""

import argparse
import itertools
import json
import subprocess
import tempfile
from pathlib import Path

GRID = {
    "friction_scale": [0.2, 0.25, 0.3],
    "finger_edge_m": [0.0, 0.0045, 0.006],
}


def tried(args, settings):
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "run"
        sets = [x for key, value in settings.items() for x in ("--set", f"{key}={value}")]
        files = sorted((args.data / "grasps").glob("*.h5"))
        command = [args.shakedown, "run", "--grasps", *files, "--mesh-root", args.data, "--quiet"]
        command += ["--limit", str(args.per_file), "--out", out, *sets]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        agreement = json.loads((out / "summary.json").read_text())["agreement"]
    keep = ("n", "tp", "fp", "fn", "tn", "balanced_accuracy", "mean_object_balanced_accuracy", "mcc", "ci95")
    return {"settings": settings, **{k: agreement[k] for k in keep}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--shakedown", default="target/release/shakedown")
    parser.add_argument("--per-file", type=int, default=10)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=V1,V2", help="another axis instead of the grid")
    args = parser.parse_args()
    grid = {k: v.split(",") for k, v in (s.split("=") for s in args.set)} or GRID
    results = json.loads(args.out.read_text()) if args.out.exists() else []
    for values in itertools.product(*grid.values()):
        settings = dict(zip(grid, values))
        if any(r["settings"] == settings for r in results):
            continue
        results.append(tried(args, settings))
        results.sort(key=lambda r: -r["balanced_accuracy"] - r["mean_object_balanced_accuracy"])
        args.out.write_text(json.dumps(results, indent=1) + "\n")
        last = next(r for r in results if r["settings"] == settings)
        print(settings, f"{last['balanced_accuracy']:.3f} {last['mean_object_balanced_accuracy']:.3f}", flush=True)
    print("best:", results[0]["settings"])


if __name__ == "__main__":
    main()
