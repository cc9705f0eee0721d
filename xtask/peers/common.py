"""What the scripts of this folder share: the scene file, surfaces, and the run from IN.json to OUT.json."""
import json
import sys

import numpy as np


def lame(scene):
    """The Lame parameters mu and lambda."""
    young, poisson = scene["young_modulus"], scene["poisson_ratio"]
    return young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))


def bodies(scene):
    """Positions and tetrahedra of each body."""
    return [(np.array(b["positions"], float), np.array(b["tets"], np.int64)) for b in scene["bodies"]]


def unit_normal(plane):
    """The normal of a half-space, of length 1."""
    return np.array(plane["normal"], float) / np.linalg.norm(plane["normal"])


def surface(tets):
    """The triangles that bound the tetrahedra, facing outwards."""
    faces = np.concatenate([tets[:, [1, 2, 3]], tets[:, [0, 3, 2]], tets[:, [0, 1, 3]], tets[:, [0, 2, 1]]])
    _, inverse, count = np.unique(np.sort(faces, 1), axis=0, return_inverse=True, return_counts=True)
    return faces[count[inverse.ravel()] == 1]


def run(name, system, prepare):
    """Runs the scene of IN.json with `prepare(scene, choice)` and writes the positions at the end to OUT.json."""
    try:
        with open(sys.argv[1]) as file:
            scene = json.load(file)
        settings, frames = prepare(scene, *sys.argv[3:4])
        for positions in frames:
            pass
        if not all(np.isfinite(p).all() for p in positions):
            raise ValueError("the positions are not finite")
        with open(sys.argv[2], "w") as file:
            json.dump({"system": system, "settings": settings, "positions": [p.tolist() for p in positions]}, file)
    except Exception as error:
        sys.exit(f"{name}: {' '.join(str(error).split()) or type(error).__name__}")
