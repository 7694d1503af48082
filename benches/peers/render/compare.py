#!/usr/bin/env python3
"""goniofit beside Mitsuba 3: time from process start to file written at a given relMSE, and steady rate. See ../README.md."""

import argparse
import importlib.metadata
import json
import math
import os
import subprocess
import sys
import tempfile
import time

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
SIZE = 512
# The peer's name, goniofit's built-in scene, the subject's material, the reference's own relMSE, samples of the steady rate.
SCENES = {
    "S1": ("sphere", None, 8.8e-9, 64),
    "S2": ("sphere-on-plane", None, 5.8e-7, 64),
    "S2-phong": ("sphere-on-plane", ([0.35, 0.12, 0.06], 60.0), 6.2e-6, 64),
    "S3": ("cornell", None, 2.3e-5, 16),
    "S3-phong": ("cornell", ([0.1, 0.2, 0.4], 40.0), 5.1e-5, 16),
    "S4": ("mesh-env", None, 4.4e-6, 16),
}


def read(path):
    """The picture in linear RGB, f64, height × width × 3."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    bitmap = mi.Bitmap(path)
    names = [field.name for field in bitmap.struct_()]
    return np.array(bitmap, dtype=np.float64)[..., [names.index(c) for c in "RGB"]]


def rel_mse(image, reference):
    return float(np.mean((image - reference) ** 2 / (reference**2 + 1e-2)))


def material(path, kd, n):
    """kd/π and a Phong lobe of weight ½, as a material file."""
    lobes = [{"kind": "lambert", "weight": kd}, {"kind": "phong", "weight": [0.5] * 3, "shape": {"exponent": n}}]
    with open(path, "w") as f:
        json.dump(
            {"format": "goniofit-material", "version": 1, "model": "lambert+phong", "channels": ["r", "g", "b"],
             "lobes": lobes}, f)


class Goniofit:
    name = "goniofit"

    def __init__(self, args, scratch):
        self.args, self.scratch = args, scratch

    def command(self, scene, spp, seed, out):
        built_in, subject, _, _ = SCENES[scene]
        line = [self.args.goniofit, "render", "--json", "--threads", str(self.args.threads), "--scene", built_in,
                "--size", str(SIZE), "--samples", str(spp), "--seed", str(seed), "--out", out]
        if subject:
            path = os.path.join(self.scratch, scene + ".json")
            material(path, *subject)
            line += ["--material", path]
        return line

    def steady(self, scene, spp):
        out = os.path.join(self.scratch, "steady.exr")
        runs = [run(self.command(scene, spp, seed, out), self.args)[1] for seed in range(5)]
        return min(json.loads(text)["seconds"] for text in runs)


class Mitsuba:
    name = "Mitsuba"

    def __init__(self, args, scratch):
        self.args, self.scratch = args, scratch

    def command(self, scene, spp, seed, out):
        return [sys.executable, os.path.join(HERE, "mitsuba_peer.py"), self.args.scenes, scene, str(spp), str(seed), out]

    def steady(self, scene, spp):
        return float(run(self.command(scene, spp, 1, "--steady"), self.args)[1].split()[-1])


def run(line, args):
    """Wall time of a process, s, and what it printed."""
    env = dict(os.environ, PEER_THREADS=str(args.threads))
    start = time.perf_counter()
    done = subprocess.run(line, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    seconds = time.perf_counter() - start
    if done.returncode != 0:
        sys.exit(f"{' '.join(line)}\nended with {done.returncode}: {done.stderr}")
    return seconds, done.stdout


def note(text):
    print(text, file=sys.stderr, flush=True)


def error(tracer, scene, spp, reference, args, seed=1):
    """relMSE at `spp`, less the reference's own, and the time that it took."""
    out = os.path.join(tracer.scratch, "out.exr")
    seconds, _ = run(tracer.command(scene, spp, seed, out), args)
    found = rel_mse(read(out), reference) - SCENES[scene][2]
    note(f"{scene} {tracer.name}: {spp} samples, relMSE {found:.3g}, {seconds:.3f} s")
    return found, seconds


def least_samples(tracer, scene, reference, args):
    """The least samples per pixel that reach each target: powers of two, then between them on a line in log–log, raised until
    the picture reaches it. None where `--most` samples do not."""
    known, spp, needed = {}, 1, {}
    for target in args.targets:
        while spp <= args.most:
            if spp not in known:
                known[spp] = error(tracer, scene, spp, reference, args)[0]
            if known[spp] <= target:
                break
            spp *= 2
        if spp > args.most:
            needed[target] = None
            continue
        n = spp
        if spp > 1 and known[spp // 2] > target:
            low, high = known[spp // 2], known[spp]
            n = math.ceil(spp // 2 * 2 ** (math.log(low / target) / math.log(low / max(high, 1e-12))))
            while n < spp and error(tracer, scene, n, reference, args)[0] > target:
                n = max(n + 1, math.ceil(1.04 * n))
        needed[target] = min(n, spp)
    return needed


def timed(tracers, needed, scene, reference, args):
    """The quickest of `rounds` runs per tracer and target; the tracers take turns."""
    times = {}
    for round_ in range(args.rounds):
        for tracer in tracers if round_ % 2 == 0 else tracers[::-1]:
            for target in args.targets:
                spp = needed[tracer.name][target]
                if spp:
                    seconds = error(tracer, scene, spp, reference, args, seed=2 + round_)[1]
                    key = (tracer.name, target)
                    times[key] = min(times.get(key, math.inf), seconds)
    return times


def row(scene, needed, times, rates, targets):
    cells = [scene]
    for target in targets:
        ours, theirs = (times.get((name, target)) for name in ("goniofit", "Mitsuba"))
        for name, seconds in (("goniofit", ours), ("Mitsuba", theirs)):
            cells.append(f"{seconds:.3f} ({needed[name][target]})" if seconds else "not reached")
        cells.append(f"{ours / theirs:.2f}" if ours and theirs else "–")
    cells += [f"{rates[name]:.1f}" for name in ("goniofit", "Mitsuba")] + [f"{rates['goniofit'] / rates['Mitsuba']:.2f}"]
    return "| " + " | ".join(cells) + " |"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--goniofit", default=os.path.join(HERE, "../../../target/release/goniofit"), help="the binary")
    parser.add_argument("--scenes", required=True, help="module with the scenes for Mitsuba")
    parser.add_argument("--reference", required=True, help="folder of NAME.exr")
    parser.add_argument("--only", default=",".join(SCENES), help="scenes, with commas between")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--targets", type=float, nargs="+", default=[1e-3, 1e-4], help="relMSE to reach, falling")
    parser.add_argument("--most", type=int, default=4096, help="samples per pixel that are tried at most")
    args = parser.parse_args()
    peer = f"Mitsuba {importlib.metadata.version('mitsuba')}"
    print(f"{SIZE}², {args.threads} threads, best of {args.rounds} processes; {peer}; in brackets samples per pixel.\n")
    note(f"load {os.getloadavg()[0]:.1f} at the start")
    head = [f"{what} {t:g}" for t in args.targets for what in ("goniofit, s to", "Mitsuba, s to", "ratio")]
    print("| scene | " + " | ".join(head) + " | goniofit, Msamples/s | Mitsuba | ratio |")
    print("|---" * (len(head) + 4) + "|", flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        tracers = [Goniofit(args, scratch), Mitsuba(args, scratch)]
        for scene in args.only.split(","):
            reference = read(os.path.join(args.reference, scene + ".exr"))
            needed = {t.name: least_samples(t, scene, reference, args) for t in tracers}
            times = timed(tracers, needed, scene, reference, args)
            spp = SCENES[scene][3]
            rates = {t.name: SIZE * SIZE * spp / t.steady(scene, spp) / 1e6 for t in tracers}
            print(row(scene, needed, times, rates, args.targets), flush=True)
    note(f"load {os.getloadavg()[0]:.1f} at the end")


if __name__ == "__main__":
    main()
