"""Renders a sphere under one distant light, and optionally a constant surrounding, with Mitsuba 3 and prints the pixels as one JSON object.

Argument: a JSON file {"bsdf": path of an exported material, "size": [w, h], "samples": n, "from": [x, y, z], "field_of_view_deg": d, "towards": [x, y, z],
"surrounding": radiance or 0, "variant": name, "timed": rounds, "cores": number or 0}. One variant a process: a back end that does not fit the machine may end it.
Exit code 77 where the package is missing.
"""

import json
import os
import sys
import time

with open(sys.argv[1], encoding="utf-8") as f:
    JOB = json.load(f)
if JOB.get("cores"):
    # before the renderer counts them
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: JOB["cores"]])

try:
    import numpy as np
    import mitsuba as mi
except ImportError:
    sys.exit(77)


def scene(job):
    """The scene of the job."""
    towards = job["towards"]
    whole = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2, "hide_emitters": True},
        "sensor": {
            "type": "perspective",
            "fov": job["field_of_view_deg"],
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(origin=job["from"], target=[0, 0, 0], up=[0, 1, 0]),
            "film": {
                "type": "hdrfilm",
                "width": job["size"][0],
                "height": job["size"][1],
                "rfilter": {"type": "box"},
                "pixel_format": "rgba",
                "component_format": "float32",
            },
            "sampler": {"type": "independent", "sample_count": job["samples"]},
        },
        "body": {"type": "sphere", "material": mi.load_file(job["bsdf"])},
        "light": {
            "type": "directional",
            "direction": [-x for x in towards],
            "irradiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]},
        },
    }
    if job["surrounding"] > 0:
        whole["around"] = {"type": "constant", "radiance": {"type": "rgb", "value": [job["surrounding"]] * 3}}
    return mi.load_dict(whole)


def main(job):
    """Renders once for the pixels and to warm up, then for the time."""
    mi.set_variant(job["variant"])
    made = scene(job)
    pixels = np.array(mi.render(made))
    seconds = []
    for k in range(job["timed"]):
        begun = time.perf_counter()
        np.array(mi.render(made, seed=k + 1))
        seconds.append(time.perf_counter() - begun)
    print(json.dumps({"pixels": pixels[:, :, :4].reshape(-1, 4).tolist(), "seconds": seconds}))


main(JOB)
