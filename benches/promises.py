#!/usr/bin/env python3
"""How often promises of the command line are kept: whole processes under `--time-budget`, and `simulate --target-error`.

    benches/promises.py                  100 trials of each, on an otherwise idle machine
    benches/promises.py --trials 10      a first look

A time budget is kept where the process, from start to exit, takes at most a tenth or 50 ms more; that of `simulate`, which is for the readings, where the
last one ends by then. What it says to be too short is not counted. A target is kept where no reading is farther off those of
a target a thousand times as small; what can't be reached is said, and then the error that is stated counts. Where the smaller target ends farther off than a
third of what is asked for, nothing is judged. Ends with 1 where an error is kept in fewer than 89 of 100; times depend on the machine and judge nothing. Needs
Python's standard library alone.
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
LEAST = 0.89  # of the trials


def goniofit(program, *words, folder):
    """Wall time of a run, s, and what it says in JSON."""
    start = time.perf_counter()
    done = subprocess.run([program, *words, "--quiet", "--json"], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    seconds = time.perf_counter() - start
    if done.returncode != 0:
        sys.exit(f"goniofit {' '.join(map(str, words))}\nended with {done.returncode}: {done.stderr}")
    return seconds, json.loads(done.stdout)


def material(rng):
    """Lambert and a Phong lobe of a random exponent."""
    kd, ks, n = rng.uniform(0.05, 0.5), rng.uniform(0.05, 0.4), 10 ** rng.uniform(0.3, 3.7)
    lobes = [{"kind": "lambert", "weight": [kd]}, {"kind": "phong", "weight": [ks], "shape": {"exponent": n}}]
    return {"format": "goniofit-material", "version": 1, "model": "lambert+phong", "channels": ["y"], "lobes": lobes}


def instrument(rng):
    """Cones of 0.3 to 6 degrees on both sides."""
    cone = lambda: 10 ** rng.uniform(-0.5, 0.8)
    return f"version = 1\n[instrument.source]\ndivergence_deg = {cone():.4f}\n[instrument.detector]\naperture_deg = {cone():.4f}\n"


def values(path):
    """Readings by their angles; what is not valid is left out."""
    rows = [line.split(",") for line in path.read_text().splitlines() if line and line[0].isdigit() or line[:1] == "-"]
    return {tuple(row[:4]): float(row[4]) for row in rows if row[4]}


def target_trial(program, folder, trial, of_table, target):
    """Of the readings of one redrawn instrument and material the largest relative error, the one that was stated, and that of what it is told by."""
    rng = random.Random(f"{trial} {of_table}")
    (folder / "truth.json").write_text(json.dumps(material(rng)))
    (folder / "it.toml").write_text(instrument(rng))
    truth = "truth.json"
    if of_table:
        # A measured material: nothing is known of it but values between which it is linear.
        goniofit(program, "simulate", "--material", truth, "--scan", "hemisphere:10", "--noiseless", "--out", "truth.csv", folder=folder)
        truth = "truth.csv"
    run = ["simulate", "--material", truth, "--instrument", "it.toml", "--scan", "in-plane:7", "--noiseless"]
    _, said = goniofit(program, *run, "--target-error", str(target), "--out", "found.csv", folder=folder)
    _, known = goniofit(program, *run, "--target-error", str(1e-3 * target), "--out", "good.csv", folder=folder)
    found, good = values(folder / "found.csv"), values(folder / "good.csv")
    return max(abs(found[at] / good[at] - 1) for at in good if good[at] != 0 and at in found), said["quadrature_error"], known["quadrature_error"]


def targets(program, folder, trials):
    print(f"| target of `simulate` | truth | kept | of trials | said to be out of reach | error, median | largest |\n|---|---|---|---|---|---|---|", flush=True)
    fine = True
    for of_table, words, asked in [(False, "a sum of lobes", [1e-2, 1e-3]), (True, "a table", [3e-2, 1e-2])]:
        for target in asked:
            tried = sorted(target_trial(program, folder, trial, of_table, target) for trial in range(trials))
            found = [(off, stated) for off, stated, known in tried if known <= max(target, stated) / 3]
            kept = sum(off <= max(target, stated) for off, stated in found)
            fine &= kept >= LEAST * len(found)
            beyond = sum(stated > target for _, stated in found)
            middle, largest = (f"{found[k][0]:.1e}" if found else "–" for k in (len(found) // 2, -1))
            print(f"| {target:g} | {words} | {kept} | {len(found)} | {beyond} | {middle} | {largest} |", flush=True)
    return fine


def budgets(program, folder, trials):
    goniofit(program, "simulate", "--material", "glossy-paint", "--scan", "merl", "--seed", "1", "--out", "glossy.binary", folder=folder)
    fit, render = ["fit", "glossy.binary", "--out", "fit.json"], ["render", "--size", "256", "--samples", "16777216", "--out", "it.exr"]
    (folder / "cones.toml").write_text("version = 1\n[instrument.source]\ndivergence_deg = 2\n[instrument.detector]\naperture_deg = 2\n")
    goniofit(program, "simulate", "--material", "glossy-paint", "--scan", "hemisphere:10", "--out", "paint.csv", folder=folder)
    simulate = ["simulate", "--material", "paint.csv", "--instrument", "cones.toml", "--scan", "hemisphere:10", "--out", "it.csv"]
    cases = [
        (fit + ["--loss", "log"], 0.2), (fit + ["--robust", "huber"], 0.5), (fit, 0.1),
        (render + ["--scene", "sphere-on-plane"], 0.5), (render + ["--scene", "cornell"], 1), (render + ["--scene", "mesh-env"], 2),
        (simulate, 0.5), (simulate, 2),
    ]
    print(f"| command | budget | kept within 10 % or 50 ms | of trials | said to be too short | median | longest |\n|---|---|---|---|---|---|---|", flush=True)
    for words, budget in cases:
        seeded = words[0] != "fit"
        runs = (
            goniofit(program, *words, "--time-budget", f"{1e3 * budget:.0f}ms", *(["--seed", str(k)] if seeded else []), folder=folder)
            for k in range(trials)
        )
        # Only simulate predicts whether it can be done at all.
        fits = lambda said: words[0] != "simulate" or said["time_budget"]["fits"]
        runs = [(said.get("seconds_to_last_reading", wall), fits(said)) for wall, said in runs]
        took = sorted(seconds for seconds, possible in runs if possible)
        kept = sum(x <= budget + max(0.1 * budget, 0.05) for x in took)
        shown = " ".join(w for w in words if w not in ("--out", "fit.json", "it.exr", "it.csv", "--samples", "16777216"))
        middle, longest = (f"{took[k]:.2f} s" if took else "–" for k in (len(took) // 2, -1))
        print(f"| `{shown}` | {budget:g} s | {kept} | {len(took)} | {trials - len(took)} | {middle} | {longest} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--goniofit", type=Path, default=TARGET / "release" / "goniofit", help="the binary")
    parser.add_argument("--only", choices=["budgets", "targets"], help="one part")
    options = parser.parse_args()
    fine = True
    with tempfile.TemporaryDirectory() as scratch:
        folder, program = Path(scratch), options.goniofit.resolve()
        if options.only != "targets":
            budgets(program, folder, options.trials)
            print()
        if options.only != "budgets":
            fine = targets(program, folder, options.trials)
    sys.exit(0 if fine else "a target is kept too seldom")


if __name__ == "__main__":
    main()
