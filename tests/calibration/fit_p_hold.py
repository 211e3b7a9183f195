"""Fits p_hold to labels and writes it as JSON; judges it on files it never saw.

    cargo run --release -p shakedown_tests --bin hold_features -- ACRONYM/seen 100 seen.csv
    cargo run --release -p shakedown_tests --bin hold_features -- ACRONYM/seen 1000 more.csv geometry
    cargo run --release -p shakedown_tests --bin hold_features -- ACRONYM/unseen 400 unseen.csv
    python3 tests/calibration/fit_p_hold.py seen.csv more.csv unseen.csv metrics/models

Gradient-boosted trees of scikit-learn; trees and calibration are chosen by cross-validation over
the objects of `seen` alone. Labels without a trial (`more.csv`) are cheap: they teach the geometry,
their trial's features missing, and weigh less than those with one. Needs numpy, pandas, scikit-learn.
"""

import json
import sys
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score
from sklearn.model_selection import GroupKFold

GEOMETRIC = 57
SETTINGS = dict(learning_rate=0.05, max_leaf_nodes=12, min_samples_leaf=100, l2_regularization=5.0,
                max_features=0.4, early_stopping=False, random_state=0)
TREES = 350
# Weight of a label with a trial beside one without.
TRIED = 5.0
# Share of the labels without a trial that is learned from.
SHARE = 0.5


def preset_version():
    preset = Path(__file__).parents[2] / "sim/protocols/acronym.toml"
    return tomllib.loads(preset.read_text())["version"]


def category(name):
    return name.split("_")[0]


def make():
    return HistGradientBoostingClassifier(max_iter=TREES, **SETTINGS)


def fit(x, y, more_x, more_y):
    """Trees for both kinds of rows."""
    weight = np.r_[np.full(len(y), TRIED), np.ones(len(more_y))]
    return make().fit(np.vstack([x, more_x]), np.r_[y, more_y], sample_weight=weight)


def out_of_fold(x, y, groups, more_x, more_y, more_groups):
    logit = np.zeros(len(y))
    for train, test in GroupKFold(10).split(x, y, groups):
        other = ~np.isin(more_groups, groups[test].unique())
        model = fit(x[train], y[train], more_x[other], more_y[other])
        logit[test] = model.decision_function(x[test])
    return logit


def ece(p, y, bins=10):
    which = np.minimum((p * bins).astype(int), bins - 1)
    return sum(abs(p[which == b].mean() - y[which == b].mean()) * (which == b).mean()
               for b in range(bins) if (which == b).any())


def precision_at(frame, p, k=10):
    frame = frame.assign(p=p)
    return frame.sort_values("p", ascending=False).groupby("object").head(k).label.mean()


def trees_of(model):
    trees = []
    for predictor in model._predictors:
        nodes = predictor[0].nodes
        # Children after their parent: breadth first.
        order, at = [0], {0: 0}
        for i in order:
            if not nodes[i]["is_leaf"]:
                for child in (int(nodes[i]["left"]), int(nodes[i]["right"])):
                    at[child] = len(order)
                    order.append(child)
        tree = []
        for i in order:
            node = nodes[i]
            if node["is_leaf"]:
                tree.append({"value": float(np.float32(round(float(node["value"]), 5)))})
            else:
                # At most the threshold goes left; rounded up so that no case changes sides.
                limit = np.float32(node["num_threshold"])
                # Infinite: only what is missing goes right. JSON knows no infinity.
                limit = min(limit, np.finfo(np.float32).max)
                tree.append({"feature": int(node["feature_idx"]), "at_most": float(limit),
                             "missing_left": bool(node["missing_go_to_left"]),
                             "left": at[int(node["left"])], "right": at[int(node["right"])]})
        trees.append(tree)
    return trees


def main():
    seen, more, unseen = (pd.read_csv(name) for name in sys.argv[1:4])
    out = sys.argv[4]
    more = more[np.random.default_rng(1).random(len(more)) < SHARE]
    names = list(seen.columns[3:])
    y, yu = seen.label.to_numpy(), unseen.label.to_numpy()
    print(f"seen {len(y)} grasps, {y.mean():.3f} hold; unseen {len(yu)}, {yu.mean():.3f}")
    for file, count in (("geometry", GEOMETRIC), ("acronym", len(names))):
        x = seen[names[:count]].to_numpy(np.float32)
        xu = unseen[names[:count]].to_numpy(np.float32)
        more_x = more[names[:count]].to_numpy(np.float32)
        more_y = more.label.to_numpy()
        fold = out_of_fold(x, y, seen.object, more_x, more_y, more.object.to_numpy())
        platt = LogisticRegression(C=1e6).fit(fold[:, None], y)
        slope, shift = float(platt.coef_[0, 0]), float(platt.intercept_[0])
        model = fit(x, y, more_x, more_y)
        p = 1 / (1 + np.exp(-(slope * model.decision_function(xu) + shift)))
        pf = 1 / (1 + np.exp(-(slope * fold + shift)))
        print(f"{file:9s} seen (out of fold) AUROC {roc_auc_score(y, fold):.4f} ECE {ece(pf, y):.3f}"
              f" | unseen AUROC {roc_auc_score(yu, p):.4f} ECE {ece(p, yu):.3f}"
              f" precision@10 {precision_at(unseen, p):.3f}")
        for name, part in unseen.assign(p=p).groupby(unseen.object.map(category)):
            auc = roc_auc_score(part.label, part.p) if part.label.nunique() > 1 else float("nan")
            print(f"    {name:14s} n {len(part):5d} base {part.label.mean():.3f} AUROC {auc:.3f}"
                  f" precision@10 {precision_at(part, part.p):.3f}")
        about = (f"p_hold from {'geometry and one trial' if count > GEOMETRIC else 'geometry alone'};"
                 f" {TREES} trees fitted to {len(y)} FleX labels of {seen.object.nunique()} ACRONYM objects (seen)"
                 f" and, without a trial, {len(more)} more")
        text = {"about": about, "protocol": preset_version(), "features": names[:count],
                "base": float(model._baseline_prediction[0, 0]), "calibration": [slope, shift]}
        body = json.dumps(text)[:-1] + ', "trees": [\n'
        body += ",\n".join(json.dumps(t, separators=(",", ":")) for t in trees_of(model))
        with open(f"{out}/p_hold_{file}.json", "w") as f:
            f.write(body + "\n]}\n")


if __name__ == "__main__":
    main()
