"""Same grasps, same protocol, two engines: do our trial and MuJoCo give the same verdict?

    python tests/cross_engine/compare.py --data ../shared/acronym/seen --out docs/validation

Runs `shakedown run` (true surface) and `shakedown export-mjcf` (convex pieces, all that MuJoCo takes),
plays the exported trials in MuJoCo and writes cross_engine_PROTOCOL.json with one line per
disagreement.
"""

import argparse
import collections
import csv
import json
import math
import multiprocessing
import subprocess
import tempfile
import time
from pathlib import Path

from engine import Trial

OBJECTS = [
    "Bottle_4b5f54fc4e629371cf078dc7b29022e6", "Bottle_d2e7e725aa6b39f0d333084c1357713e",
    "Bowl_4eefe941048189bdb8046e84ebdc62d2", "Bowl_c5a2f2b3879", "Hat_a8ddbd8c9cdb3088d2eebe596133133e",
    "Knife_89f69d95f5598fddd42a2a5a47e9ed5", "Knife_581ad58ce8664d2d4ff0e6230d32c1e3",
    "Mug_10f6e09036350e92b3f21f1137c3c347", "Mug_b7841572364fd9ce1249ffc39a0c3c0b",
    "Scissors_375b437bcf89c27de0c8359faeb78bbe",
]


def play(job):
    key, directory, ours = job
    trial = Trial(directory)
    start = time.process_time()
    theirs = trial.run()
    theirs["cpu_s"] = time.process_time() - start
    return key, ours, theirs


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--shakedown", default="target/release/shakedown")
    parser.add_argument("--protocol", default="acronym")
    parser.add_argument("--per-object", type=int, default=50)
    parser.add_argument("--set", action="append", default=[])
    args = parser.parse_args()
    sets = [x for s in args.set for x in ("--set", s)]
    jobs = []
    with tempfile.TemporaryDirectory() as scratch:
        for name in OBJECTS:
            file = sorted((args.data / "grasps").glob(name + "*.h5"))[0]
            common = ["--grasps", file, "--mesh-root", args.data, "--protocol", args.protocol, *sets, "--quiet"]
            run = Path(scratch) / name / "run"
            limit = ["--limit", str(args.per_object), "--out", run]
            subprocess.run([args.shakedown, "run", *common, *limit], check=True, stdout=subprocess.DEVNULL)
            rows = list(csv.DictReader((run / "trials.csv").open()))
            numbers = [r["grasp"] for r in rows]
            out = Path(scratch) / name / "mjcf"
            subprocess.run(
                [args.shakedown, "export-mjcf", *common, "--grasp", *numbers, "--out", out], check=True
            )
            jobs += [((name, r["grasp"]), out / r["grasp"], r["outcome"]) for r in rows]
        with multiprocessing.Pool() as pool:
            results = pool.map(play, jobs, chunksize=4)
    held = lambda outcome: outcome == "held"
    pairs = collections.Counter((ours, theirs["outcome"]) for _, ours, theirs in results)
    same = sum(held(ours) == held(theirs["outcome"]) for _, ours, theirs in results)
    n = len(results)
    share = same / n
    error = 1.96 * math.sqrt(share * (1 - share) / n)
    report = {
        "protocol": args.protocol,
        "sets": args.set,
        "n": n,
        "same_verdict": share,
        "mujoco_trials_per_cpu_s": n / sum(theirs["cpu_s"] for _, _, theirs in results),
        "ci95": [share - error, share + error],
        "pairs": [{"shakedown": a, "mujoco": b, "n": k} for (a, b), k in pairs.most_common()],
        "disagreements": [
            {"object": key[0], "grasp": int(key[1]), "shakedown": ours, "mujoco": theirs["outcome"]}
            for key, ours, theirs in results
            if held(ours) != held(theirs["outcome"])
        ],
    }
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / f"cross_engine_{args.protocol}.json").write_text(json.dumps(report, indent=1) + "\n")
    print(f"{args.protocol}: same verdict for {same} of {n} ({share:.1%})")
    for (a, b), k in pairs.most_common():
        print(f"  ours {a:17} mujoco {b:12} {k}")


if __name__ == "__main__":
    main()
