#!/usr/bin/env python3
"""Runs goniofit and its peers on the same tables, in turn, and prints their times beside each other as Markdown.

Everything it runs must be built and generated already: run.sh does that and calls this. Needs the standard library
alone.
"""

import argparse
import datetime
import json
import os
import re
import statistics
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
MADE = ("matte", "glossy", "mirror")
MADE_SAMPLES = 909_696  # of 1,458,000 entries those with both angles up to 80 degrees
TOLERANCE = 1e-8  # relative difference of cost that passes as the same optimum
GONIOFIT_RUNS = 3  # a round: its fit is the shortest here
FLOOR_PASSES = 21  # a round
FLOORS = {"f64": "f64", "f64_folded": "f64 folded", "f32": "f32", "f32_folded": "f32 folded"}


def run(command):
    """Standard output, wall time and peak memory (MB) of a command; ends the comparison where the command fails."""
    clock = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    out = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - clock
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"exit code {process.returncode}: {' '.join(command)}")
    return out, wall, usage.ru_maxrss * 1024 / 1e6


def goniofit(options, table):
    """One fit by goniofit, a process of its own: `fit.seconds` is the fit alone, after the table was read."""
    command = [options.goniofit, "fit", table["binary"], "--json", "--quiet", "--threads", str(options.threads)]
    command += ["--model", "lambert+phong", "--loss", "cosine-l2", "--weights", "uniform"]
    out, wall, peak = run(command)
    record = json.loads(out)
    fit, lobes = record["fit"], {lobe["kind"]: lobe for lobe in record["lobes"]}
    return {
        "samples": fit["samples"],
        "seconds": [fit["seconds"]],
        "cost": fit["cost"],
        "kd": lobes["lambert"]["weight"],
        "ks": lobes["phong"]["weight"],
        "exponent": lobes["phong"]["shape"]["exponent"],
        "evaluations": fit["iterations"],
        "ended": fit["status"],
        "wall": [wall],
        "peak_mb": peak,
    }


def peer(command, table, *arguments):
    """One process of a peer, which may solve several times. Peers minimise half of goniofit's cost."""
    out, wall, peak = run([*command, table["flat"], *arguments])
    record = json.loads(out)
    return {**record, "cost": 2 * record.pop("half_cost"), "wall": [wall], "peak_mb": peak}


def solvers(options):
    """Name and call of each solver, in the order of the tables printed."""
    crates = [os.path.join(options.bin, "varpro_peer")]
    ceres = [os.path.join(options.bin, "ceres_peer")]
    scipy = [options.python, os.path.join(HERE, "scipy_peer.py")]
    solves, threads = str(options.solves), str(options.threads)
    return {
        "goniofit": lambda table: [goniofit(options, table) for _ in range(GONIOFIT_RUNS)],
        "varpro": lambda table: [peer(crates, table, "varpro", solves)],
        "Ceres": lambda table: [peer(ceres, table, solves, threads)],
        "levenberg-marquardt": lambda table: [peer(crates, table, "lm", solves)],
        "scipy": lambda table: [peer(scipy, table, solves)],
    }


def merge(runs):
    """The last run's answer with the times of all, their median and the largest peak."""
    seconds = [s for r in runs for s in r["seconds"]]
    wall = [s for r in runs for s in r["wall"]]
    return {
        **runs[-1],
        "seconds": seconds,
        "median_seconds": statistics.median(seconds),
        "wall": wall,
        "median_wall": statistics.median(wall),
        "peak_mb": max(r["peak_mb"] for r in runs),
    }


def merge_floors(runs):
    """The last run's answer with the times of all passes and the quickest of each kind: a floor holds no noise."""
    seconds = {kind: [s for r in runs for s in r["seconds"][kind]] for kind in FLOORS}
    return {**runs[-1], "seconds": seconds, "least_seconds": {kind: min(s) for kind, s in seconds.items()}}


def measure(options, table):
    """All solvers and the floor on one table, round by round, so that a noisy spell of the machine meets all alike."""
    calls = solvers(options)
    runs, floors = {name: [] for name in calls}, []
    for number in range(options.rounds):
        print(f"{table['name']}: round {number + 1} of {options.rounds}", file=sys.stderr)
        order = list(calls) if number % 2 == 0 else list(reversed(calls))
        for name in order:
            runs[name] += calls[name](table)
        exponent = repr(runs["goniofit"][-1]["exponent"])
        floor = [os.path.join(options.bin, "floor"), table["flat"], exponent, str(FLOOR_PASSES), str(options.threads)]
        floors.append(json.loads(run(floor)[0]))
    found = {name: merge(r) for name, r in runs.items()}
    best = min(f["cost"] for f in found.values())
    for f in found.values():
        f["cost_over_best"] = f["cost"] / best - 1
        f["times_goniofit"] = f["median_seconds"] / found["goniofit"]["median_seconds"]
    return {"solvers": found, "floor": merge_floors(floors), "best_cost": best}


def complaints(name, result):
    """What keeps this table's times from being compared."""
    samples = result["solvers"]["goniofit"]["samples"]
    if name in MADE and samples != MADE_SAMPLES:
        yield f"{name}: {samples} samples, not {MADE_SAMPLES}"
    if result["floor"]["samples"] != samples:
        yield f"{name}: floor saw {result['floor']['samples']} samples, goniofit {samples}"
    for solver, found in result["solvers"].items():
        if found["samples"] != samples:
            yield f"{name}: {solver} saw {found['samples']} samples, goniofit {samples}"
        if not found["cost_over_best"] <= TOLERANCE:
            best = min(result["solvers"].values(), key=lambda f: f["cost"])
            signs = "; the best has a negative weight, which goniofit does not allow"
            why = signs if min(best["kd"] + best["ks"]) < 0 else ""
            yield f"{name}: {solver} ended {found['cost_over_best']:.1e} above the best cost ({found['ended']}){why}"
    floor = 2 * result["floor"]["half_cost"]["f64_folded"] / result["best_cost"] - 1
    if not abs(floor) <= TOLERANCE:
        yield f"{name}: the floor's sums give a cost {floor:.1e} off the best"


def machine():
    """Processor, cores and system."""
    fields = {f["field"].rstrip(":"): f["data"] for f in json.loads(run(["lscpu", "-J"])[0])["lscpu"]}
    system = " ".join(os.uname()[i] for i in (0, 2, 4))
    return {"processor": fields.get("Model name"), "cpus": os.cpu_count(), "system": system}


def commit():
    """The commit of this working tree, if it is one."""
    said = subprocess.run(["git", "-C", HERE, "describe", "--always", "--dirty"], capture_output=True, text=True)
    return said.stdout.strip() or None


def lapack(options):
    """The libraries behind varpro's QR: LAPACK has several makers."""
    linked = run(["ldd", os.path.join(options.bin, "varpro_peer")])[0].decode()
    return [os.path.realpath(p) for p in re.findall(r"=> (\S*lib(?:lapack|blas)\S*)", linked)]


def markdown(report):
    """What is printed."""
    m = report["machine"]
    load = report["load_average"]
    yield f"{m['processor']}, {m['cpus']} CPUs, {m['system']}; {report['date']}; commit {report['commit']};"
    yield f"load average {load[0]:.1f} before, {load[1]:.1f} after."
    yield ""
    yield from summary(report)
    yield ""
    yield "What each reached:"
    yield ""
    yield "| table | solver | cost / best − 1 | n | evaluations | whole process [s] | peak [MB] |"
    yield "|---" * 7 + "|"
    for name, result in report["tables"].items():
        for solver, f in result["solvers"].items():
            reached = f"{f['cost_over_best']:.1e} | {f['exponent']:.8g} | {f['evaluations']}"
            yield f"| {name} | {solver} | {reached} | {f['median_wall']:.2f} | {f['peak_mb']:.0f} |"


def summary(report):
    """The tables that a reader looks for first: times of the fits, what each solver takes and reaches, passes over the samples."""
    tables, threads = report["tables"], report["threads"]
    solvers = list(next(iter(tables.values()))["solvers"])
    peers = [n for n in solvers if n != "goniofit"]
    yield "; ".join(report["versions"].values()) + f"; varpro's LAPACK {', '.join(report['lapack'])};"
    yield f"medians of {report['rounds']} rounds; {threads} threads."
    yield ""
    yield "Seconds of a fit, and how many times goniofit's that is:"
    yield ""
    yield "| table | n | goniofit | " + " | ".join(peers) + " |"
    yield "|---" * (3 + len(peers)) + "|"
    for name, result in tables.items():
        found = result["solvers"]
        cells = [f"{found[p]['median_seconds']:.3f} ({found[p]['times_goniofit']:.0f}×)" for p in peers]
        own = found["goniofit"]
        yield f"| {name} | {own['exponent']:.4g} | {own['median_seconds']:.3f} | " + " | ".join(cells) + " |"
    yield ""
    yield "Least and most over all tables:"
    yield ""
    yield "| solver | times goniofit's | cost over the best − 1, at most | whole process [s] | peak memory [MB] |"
    yield "|---" * 5 + "|"
    for solver in solvers:
        found = [result["solvers"][solver] for result in tables.values()]
        times, walls, peaks = ([f[key] for f in found] for key in ("times_goniofit", "median_wall", "peak_mb"))
        off = max(f["cost_over_best"] for f in found)
        walls, peaks = f"{min(walls):.2f} to {max(walls):.2f}", f"{min(peaks):.0f} to {max(peaks):.0f}"
        yield f"| {solver} | {min(times):.0f} to {max(times):.0f} | {off:.1e} | {walls} | {peaks} |"
    yield ""
    yield f"Milliseconds of the quickest pass over the samples ({threads} threads), and goniofit's fit in passes:"
    yield ""
    yield "| table | " + " | ".join(FLOORS.values()) + " | fit / f64 | fit / f64 folded |"
    yield "|---" * (3 + len(FLOORS)) + "|"
    for name, result in tables.items():
        passes, own = result["floor"]["least_seconds"], result["solvers"]["goniofit"]["median_seconds"]
        cells = [f"{1e3 * passes[kind]:.2f}" for kind in FLOORS]
        cells += [f"{own / passes[kind]:.0f}" for kind in ("f64", "f64_folded")]
        yield f"| {name} | " + " | ".join(cells) + " |"


def tables_of(options):
    """The tables that have a flat file, the made ones first."""
    binaries = {}
    for path in [os.path.join(options.tables, f"{name}.binary") for name in MADE] + options.binaries:
        name = os.path.splitext(os.path.basename(path))[0]
        if name in binaries:
            sys.exit(f"two tables are named {name}: {binaries[name]}, {path}")
        binaries[name] = path
    flats = {name: os.path.join(options.flat, f"{name}.flat") for name in binaries}
    return [{"name": n, "binary": b, "flat": flats[n]} for n, b in binaries.items() if os.path.exists(flats[n])]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--goniofit", required=True, help="the program under test")
    parser.add_argument("--bin", required=True, help="folder of the peers' programs")
    parser.add_argument("--python", default=sys.executable, help="a Python that has numpy and scipy")
    parser.add_argument("--tables", required=True, help="folder of matte, glossy and mirror.binary")
    parser.add_argument("--flat", required=True, help="folder of the flat files")
    parser.add_argument("--json", required=True, help="where to write all numbers")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--solves", type=int, default=2, help="of each peer's process, a round")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("binaries", nargs="*", help="more tables, MERL .binary")
    options = parser.parse_args()

    report = {
        "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
        "machine": machine(),
        "commit": commit(),
        "rounds": options.rounds,
        "threads": options.threads,
        "load_average": [os.getloadavg()[0]],
        "tables": {table["name"]: measure(options, table) for table in tables_of(options)},
    }
    report["load_average"].append(os.getloadavg()[0])
    first = next(iter(report["tables"].values()))
    report["versions"] = {"goniofit": run([options.goniofit, "--version"])[0].decode().strip()}
    report["versions"] |= {name: f["version"] for name, f in first["solvers"].items() if name != "goniofit"}
    report["versions"]["floor"] = first["floor"]["version"]
    report["lapack"] = lapack(options)
    report["complaints"] = [c for name, result in report["tables"].items() for c in complaints(name, result)]
    with open(options.json, "w") as out:
        json.dump(report, out, indent=1)
    print("\n".join(markdown(report)))
    for complaint in report["complaints"]:
        print(f"FAILED: {complaint}", file=sys.stderr)
    if report["complaints"]:
        sys.exit(1)


if __name__ == "__main__":
    main()
