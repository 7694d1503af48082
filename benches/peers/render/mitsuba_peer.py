#!/usr/bin/env python3
"""One picture by Mitsuba 3, or its steady rate.

    mitsuba_peer.py SCENES.py NAME SPP SEED OUT.exr      render and write, then end: the caller times the process
    mitsuba_peer.py SCENES.py NAME SPP SEED --steady     a first render, then five: prints the quickest, s

SCENES.py is a module with `make(name, sampler, spp)`, which gives a scene as Mitsuba's dictionary, and `register_phong()`.
"""

import importlib.util
import os
import sys
import time


def module(path):
    spec = importlib.util.spec_from_file_location("scenes", path)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def main():
    path, name, spp, seed, out = sys.argv[1:6]
    spp, seed = int(spp), int(seed)
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(os.environ.get("PEER_VARIANT", "llvm_ad_rgb"))
    mi.set_log_level(mi.LogLevel.Error)
    dr.set_thread_count(int(os.environ.get("PEER_THREADS", "2")))
    scenes = module(path)
    if "phong" in name:
        scenes.register_phong()
    scene = mi.load_dict(scenes.make(name, sampler="multijitter", spp=spp))
    if out != "--steady":
        mi.Bitmap(mi.render(scene, spp=spp, seed=seed)).write(out)
        return
    times = []
    for i in range(6):
        start = time.perf_counter()
        dr.eval(image := mi.render(scene, spp=spp, seed=seed + i))
        dr.sync_thread()
        del image
        times.append(time.perf_counter() - start)
    print(min(times[1:]))


if __name__ == "__main__":
    main()
