"""Do epsilon and wrench-space volume tell which grasps hold? AUROC against labels and trials.

    shakedown run --grasps ACRONYM/seen/grasps/*.h5 --mesh-root ACRONYM/seen --limit 20 --wrench --out DIR
    shakedown classify ... --wrench --out DIR2          # the contacts that geometry predicts
    python3 tests/calibration/wrench_auroc.py DIR DIR2

Needs pandas and scikit-learn.
"""

import sys

import pandas as pd
from sklearn.metrics import roc_auc_score


def main():
    tried = pd.read_csv(f"{sys.argv[1]}/trials.csv")
    predicted = pd.read_csv(f"{sys.argv[2]}/trials.csv")
    for name, run in (("predicted by geometry", predicted), ("found by the trial", tried)):
        both = run.merge(tried[["object", "grasp", "held"]], on=["object", "grasp"],
                         suffixes=("_x", ""))
        for column in ("epsilon", "wrench_volume"):
            value = both[column].fillna(0.0)
            print(f"{name:22s} {column:14s} label {roc_auc_score(both.label, value):.3f}"
                  f" trial {roc_auc_score(both.held, value):.3f}")
        print(f"{name:22s} force closure  {(both.epsilon > 0).mean():.3f} of the grasps")


if __name__ == "__main__":
    main()
