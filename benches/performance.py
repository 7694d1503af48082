#!/usr/bin/env python3
"""Writes docs/performance.md from fresh measurements, its prose from performance.md beside this file.

    benches/performance.py                     all sections, in the order of the page
    benches/performance.py stages process      these; the others stay as they are, each with its own date
    benches/performance.py --keep              what can't be measured here stays as it was too, instead of saying what is missing
    benches/performance.py --list              the sections, what each runs and what is missing for it here

Every section states when, on which machine, under which load and by which command it was measured, so that sections may be measured one at a time. A
section whose run fails stays as it was; the script then ends with 1. It builds what it measures before it looks at the load. Needs Python's standard
library alone; the peers need what benches/peers/README.md says.
"""

import argparse
import datetime
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
TEMPLATE = HERE / "performance.md"
PAGE = ROOT / "docs" / "performance.md"
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
GONIOFIT = TARGET / "release" / "goniofit"
BUSY = 0.35  # load average per CPU before a measurement, from which on it says that the machine was busy
WIDTH = 160  # of the page's lines
ROUNDS = 5  # of a whole process: the quickest counts


class Failed(Exception):
    """Why a section could not be measured."""


def say(text):
    print(text, file=sys.stderr, flush=True)


def output(command, **how):
    """What a command prints; its stderr goes to ours."""
    words = [str(word) for word in command]
    say("$ " + " ".join(words))
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, cwd=ROOT, **how)
    if done.returncode != 0:
        raise Failed(f"exit code {done.returncode} of {' '.join(words)}\n{done.stdout}")
    return done.stdout


def tables(text):
    """The Markdown tables in a text, and the sentences below them."""
    lines = text.splitlines()
    first = next((i for i, line in enumerate(lines) if line.startswith("|")), None)
    if first is None:
        raise Failed(f"no table in what was printed:\n{text}")
    return "\n".join(lines[first:]).strip()


def bench(name, *arguments):
    return output(["cargo", "bench", "--quiet", "--locked", "--bench", name, "--", *arguments])


def missing_programs(*names):
    return [name for name in names if not shutil.which(name)]


# Sections: what each runs, as one would type it; what it lacks here; its Markdown.


class Bench:
    """A bench that prints Markdown."""

    def __init__(self, name, quick=(), arguments=()):
        self.name, self.quick, self.arguments = name, list(quick), list(arguments)

    def command(self, options):
        more = self.arguments + (self.quick if options.quick else [])
        return f"cargo bench --bench {self.name}" + (f" -- {' '.join(more)}" if more else "")

    def missing(self, options):
        return []

    def build(self, options):
        output(["cargo", "bench", "--quiet", "--locked", "--no-run", "--bench", self.name])

    def measure(self, options):
        return tables(bench(self.name, *self.arguments, *(self.quick if options.quick else [])))


class Stages(Bench):
    """Criterion's medians, read from the files that it leaves."""

    def __init__(self):
        super().__init__("stages")

    def command(self, options):
        return "cargo bench --bench stages"

    def measure(self, options):
        began = time.time()
        bench("stages", "--noplot")
        # Files of earlier runs may lie there too.
        files = [p for p in (TARGET / "criterion").rglob("new/estimates.json") if p.stat().st_mtime >= began]
        if not files:
            raise Failed(f"no estimates in {TARGET / 'criterion'}")
        rows = ["| stage | what | median | 95 % interval | a second |", "|---|---|---|---|---|"]
        for path in sorted(files, key=lambda p: p.stat().st_mtime):
            about = json.loads((path.parent / "benchmark.json").read_text())
            median = json.loads(path.read_text())["median"]
            low, high = (median["confidence_interval"][end] for end in ("lower_bound", "upper_bound"))
            of = about["throughput"] or {}
            rate = f"{of['Elements'] / median['point_estimate'] * 1e3:.3g} million" if "Elements" in of else ""
            cells = [about["group_id"], about["function_id"], span(median["point_estimate"]), f"{span(low)} to {span(high)}"]
            rows.append("| " + " | ".join([*cells, rate]) + " |")
        return "\n".join(rows)


def span(nanoseconds):
    """A time as one reads it."""
    for unit, size in (("s", 1e9), ("ms", 1e6), ("µs", 1e3)):
        if nanoseconds >= size:
            return f"{nanoseconds / size:.3g} {unit}"
    return f"{nanoseconds:.3g} ns"


class ZeroCost:
    """Instructions of effects that are off, by callgrind."""

    def command(self, options):
        return "benches/zero-cost.sh"

    def missing(self, options):
        return missing_programs("valgrind")

    def build(self, options):
        output(["cargo", "bench", "--quiet", "--locked", "--no-run", "--bench", "effects"])

    def measure(self, options):
        return tables(output([HERE / "zero-cost.sh"]))


class Process:
    """Whole processes, from start to exit: wall time, processor time and peak memory."""

    FITS = [[], ["--loss", "log"], ["--loss", "cuberoot"], ["--robust", "huber"], ["--robust", "cauchy"], ["--per-channel"], ["--model", "auto"]]

    def command(self, options):
        return "benches/performance.py process"

    def missing(self, options):
        return []

    def build(self, options):
        build_goniofit()

    def measure(self, options):
        with tempfile.TemporaryDirectory() as folder:
            make = ["simulate", "--material", "glossy-paint", "--scan", "merl", "--seed", "1", "--out", "glossy.binary"]
            whole_process(make, folder)
            runs = [["fit", "glossy.binary", *more, "--out", "fit.json"] for more in self.FITS]
            rows = [self.row(words, words, folder) for words in [make, *runs]]
            found = decoded(options)
            if found:
                shown = ["fit", f"({len(found)} tables)", "--out-dir", "fits"]
                rows.append(self.row(shown, ["fit", *found, "--out-dir", "fits"], folder))
            rows.append(self.row(["demo"], ["demo"], folder))
        head = ["| command | s, start to exit | s of processors | peak, MB |", "|---|---|---|---|"]
        return "\n".join(head + rows) + f"\n\nThe quickest of {ROUNDS} runs each, files in the cache; the peak is the largest of them."

    @staticmethod
    def row(shown, words, folder):
        runs = [whole_process(words, folder) for _ in range(ROUNDS)]
        wall, used, _ = min(runs)
        return f"| `goniofit {' '.join(shown)}` | {wall:.2f} | {used:.2f} | {max(run[2] for run in runs):.0f} |"


def whole_process(words, folder):
    """Wall time and processor time, s, and peak memory, MB, of one run of goniofit."""
    clock = time.perf_counter()
    child = subprocess.Popen([GONIOFIT, *words, "--quiet"], cwd=folder, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    wall = time.perf_counter() - clock
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise Failed(f"exit code {child.returncode} of goniofit {' '.join(map(str, words))}")
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6


def build_goniofit():
    output(["cargo", "build", "--quiet", "--release", "--locked", "--bin", "goniofit"])


def decoded(options):
    """MERL tables of the folder that was named."""
    return sorted(Path(options.tables).resolve().glob("*.binary")) if options.tables else []


class FitPeers:
    """The fit beside other solvers."""

    SCRIPT = HERE / "peers" / "fit" / "run.sh"

    def command(self, options):
        more = (["--rounds 1", "--solves 1"] if options.quick else []) + (["FOLDER"] if options.tables else [])
        return " ".join(["benches/peers/fit/run.sh", *more])

    def missing(self, options):
        if options.install:
            return []
        packages = ["libceres-dev", "libeigen3-dev", "libgoogle-glog-dev", "liblapack-dev", "libblas-dev"]
        return missing_programs("g++", "gcc") + [p for p in packages if not installed(p)]

    def build(self, options):
        build_goniofit()

    def measure(self, options):
        numbers = TARGET / "peers" / "fit.json"
        words = [self.SCRIPT, "--scratch", TARGET / "peers", "--json", numbers, "--goniofit", GONIOFIT]
        words += ["--rounds", "1", "--solves", "1"] if options.quick else []
        words += ["--install"] if options.install else []
        output(words + ([options.tables] if options.tables else []))
        report = json.loads(numbers.read_text())
        peers = module(HERE / "peers" / "fit" / "compare.py")
        return "\n".join(peers.summary(report))


def installed(package):
    if not shutil.which("dpkg-query"):
        return False
    done = subprocess.run(["dpkg-query", "-W", "-f", "${Status}", package], capture_output=True, text=True)
    return "ok installed" in done.stdout


def module(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


class Promises:
    """How often promises of the command line are kept."""

    def command(self, options):
        return "benches/promises.py" + (" --trials 10" if options.quick else "")

    def missing(self, options):
        return []

    def build(self, options):
        build_goniofit()

    def measure(self, options):
        words = [HERE / "promises.py", "--goniofit", GONIOFIT, *(["--trials", "10"] if options.quick else [])]
        return output(words).strip()


class Pictures:
    """Pictures beside Mitsuba 3."""

    def command(self, options):
        more = " --targets 1e-3 --rounds 2" if options.quick else ""
        return f"benches/peers/render/compare.py --scenes SCENES --reference FOLDER{more}"

    def missing(self, options):
        lacks = [f"{what} ({name})" for name, what, path in
                 [("--scenes", "scenes for Mitsuba", options.scenes), ("--references", "its converged pictures", options.references)]
                 if not (path and Path(path).exists())]
        done = subprocess.run([options.python, "-c", "import mitsuba, numpy"], capture_output=True)
        return lacks + (["Mitsuba 3 (--python PROGRAM that has it)"] if done.returncode else [])

    def build(self, options):
        build_goniofit()

    def measure(self, options):
        words = [options.python, HERE / "peers" / "render" / "compare.py", "--goniofit", GONIOFIT]
        words += ["--scenes", Path(options.scenes).resolve(), "--reference", Path(options.references).resolve()]
        words += ["--targets", "1e-3", "--rounds", "2"] if options.quick else []
        return output(words).strip()


SECTIONS = {
    "fit-peers": FitPeers(),
    "process": Process(),
    "precision": Bench("precision"),
    "budget": Bench("budget", quick=["--quick"]),
    "stages": Stages(),
    "effects": Bench("effects"),
    "zero-cost": ZeroCost(),
    "plans": Bench("render_accuracy", arguments=["--plans"]),
    "promises": Bench("render_accuracy", arguments=["--promises"], quick=["--trials", "10"]),
    "kept": Promises(),
    "pictures": Pictures(),
}


# The page


def place(name):
    return f"<!-- measured: {name} -->"


def block(name, text):
    return f"{place(name)}\n{text.strip()}\n<!-- end: {name} -->"


def kept(page):
    """What the page has of each section."""
    found = {}
    for name in SECTIONS:
        part = re.search(re.escape(place(name)) + r"\n(.*?)\n<!-- end: " + re.escape(name) + " -->", page, re.DOTALL)
        if part:
            found[name] = part[1]
    return found


def write(template, found):
    text = template
    for name in SECTIONS:
        unmeasured = f"Not measured yet: `benches/performance.py {name}`."
        text = text.replace(place(name), block(name, found.get(name, unmeasured)))
    PAGE.write_text(text)


def machine():
    """Processor, CPUs, system and compiler, and what differs from the project's own release build."""
    facts = {f["field"].rstrip(":"): f["data"] for f in json.loads(output(["lscpu", "-J"]))["lscpu"]}
    vectors = [name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in facts.get("Flags", "").split()]
    uname, rustc = os.uname(), output(["rustc", "--version"]).split()[1]
    commit = output(["git", "rev-parse", "--short", "HEAD"]).strip()
    changed = subprocess.run(["git", "diff", "--quiet", "HEAD", "--", "src", "benches", "Cargo.toml", "Cargo.lock"], cwd=ROOT)
    commit += " with changes" if changed.returncode else ""
    own = [f"{k}={v}" for k, v in sorted(os.environ.items()) if k.startswith("CARGO_PROFILE_") or k == "RUSTFLAGS"]
    said = f"{os.cpu_count()} CPUs {facts.get('Model name', 'unknown')}" + (f" with {vectors[0]}" if vectors else "")
    said += f", {uname.sysname} {uname.release}, rustc {rustc}, commit {commit}"
    return said + (f", built with {' '.join(own)}" if own else "")


def measured(section, options, about):
    """Runs a section; its Markdown, headed by what it was measured on."""
    before = wait(options)
    text = section.measure(options)
    after = os.getloadavg()[0]
    date = datetime.datetime.now(datetime.timezone.utc).date().isoformat()
    busy = "; the machine was busy with other work, so times are longer than they need be" if before > BUSY * os.cpu_count() else ""
    head = f"{date}, {about}; load average {before:.1f} before, {after:.1f} after{busy}."
    return "\n".join(textwrap.wrap(f"`{section.command(options)}`, {head}", WIDTH)) + f"\n\n{text}"


def wait(options):
    """The load average, once it is low or time is up."""
    end = time.monotonic() + 60 * options.wait
    while os.getloadavg()[0] > BUSY * os.cpu_count() and time.monotonic() < end:
        time.sleep(5)
    return os.getloadavg()[0]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=f"any of {', '.join(SECTIONS)} (default: all)")
    parser.add_argument("--keep", action="store_true", help="keep what the page has where a section can't be measured here")
    parser.add_argument("--list", action="store_true", help="say what each section runs and what it lacks here")
    parser.add_argument("--quick", action="store_true", help="fewer tables, trials and rounds, where a section knows how")
    parser.add_argument("--wait", type=float, default=3, metavar="MINUTES", help="for the load to fall, before each section (default 3)")
    parser.add_argument("--install", action="store_true", help="install what the fit's peers need")
    parser.add_argument("--tables", metavar="FOLDER", help="fit every *.binary (MERL) in it too")
    beside = ROOT.parent / "shared"
    parser.add_argument("--scenes", metavar="FILE.py", default=beside / "peers" / "mitsuba" / "scenes.py", help="the scenes for Mitsuba")
    parser.add_argument("--references", metavar="FOLDER", default=beside / "reference", help="their converged pictures")
    parser.add_argument("--python", default=sys.executable, metavar="PROGRAM", help="a Python that has mitsuba and numpy")
    options = parser.parse_args()
    unknown = [name for name in options.sections if name not in SECTIONS]
    if unknown:
        parser.error(f"expected sections out of {', '.join(SECTIONS)}, found {', '.join(unknown)}")
    return options


def main():
    options = arguments()
    template = TEMPLATE.read_text()
    absent = [name for name in SECTIONS if template.count(place(name)) != 1]
    if absent:
        sys.exit(f"{TEMPLATE}: expected one place each for {', '.join(absent)}")
    if options.list:
        for name, section in SECTIONS.items():
            lacks = section.missing(options)
            print(f"{name:10} {section.command(options)}" + (f"   (missing: {', '.join(lacks)})" if lacks else ""))
        return
    found, failures = kept(PAGE.read_text() if PAGE.exists() else ""), []
    wanted = [name for name in SECTIONS if name in options.sections or not options.sections]
    ready = []
    for name in wanted:
        lacks = SECTIONS[name].missing(options)
        if not lacks:
            ready.append(name)
        elif options.keep and name in found:
            say(f"{name}: kept, for here is missing: {', '.join(lacks)}")
        else:
            found[name] = f"Not measured here: {', '.join(lacks)} missing. `benches/performance.py {name}` measures it."
    write(template, found)
    for name in ready:
        SECTIONS[name].build(options)
    about = machine()
    for name in ready:
        say(f"{name}: {SECTIONS[name].command(options)}")
        try:
            found[name] = measured(SECTIONS[name], options, about)
        except Failed as why:
            failures.append(name)
            say(f"{name}: {why}")
            continue
        write(template, found)
    if failures:
        sys.exit(f"failed, and left as they were: {', '.join(failures)}")


if __name__ == "__main__":
    main()
