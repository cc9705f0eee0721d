"""Sweeps the substeps of the solver on all cores and plots the error over the time of a frame.

    python sweep.py [SCENE.toml] [--frames N] [--jobs N] [--out FILE.png]

Each run is a process of joblib's; without joblib the runs follow each other. The error is the largest distance of a particle
from the same scene with eight times the substeps of the finest run, as a part of the largest displacement. Without
matplotlib only the table is printed.
"""

import argparse

import numpy as np

import incise

try:
    import joblib
except ImportError:
    joblib = None
try:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
except ImportError:
    plt = None

SUBSTEPS = [2, 4, 8, 16, 32]

BEAM = {
    "world": {"gravity": [0.0, 0.0, -9.81]},
    "body": [
        {
            "shape": {"kind": "beam", "tets": 600},
            "young_modulus": 2e5,
            "fixed": [{"half_space": {"point": [-0.45, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0]}}],
        }
    ],
}


def run(scene, frames, substeps):
    """Positions of all frames, shape (frames, n, 3), and the mean time of a frame in ms."""
    scene = {**scene, "solver": {**scene.get("solver", {}), "method": "gauss-seidel", "substeps": substeps, "precision": "f64"}}
    sim = incise.Simulation.from_scene(scene, threads=1)
    positions, times = [sim.positions], []
    for _ in range(frames):
        times.append(sim.step()["ms"]["total"])
        positions.append(sim.positions)
    return np.array(positions), float(np.mean(times))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", help="scene file without strokes; without one a beam that bends")
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=-1, help="processes; -1 for one on each core")
    parser.add_argument("--out", default="sweep.png", help="plot, a .png file")
    arguments = parser.parse_args()
    scene = incise.load_scene(arguments.scene) if arguments.scene else BEAM
    if scene.get("stroke"):
        parser.error("the scene has strokes: positions are compared particle by particle, and cuts add particles")

    runs = [*SUBSTEPS, 8 * SUBSTEPS[-1]]
    if joblib is None:
        print("joblib is not installed (pip install joblib): one run after the other")
        results = [run(scene, arguments.frames, substeps) for substeps in runs]
    else:
        # The finest run takes longest: it is first.
        order = sorted(runs, reverse=True)
        done = joblib.Parallel(n_jobs=arguments.jobs)(joblib.delayed(run)(scene, arguments.frames, n) for n in order)
        results = [done[order.index(substeps)] for substeps in runs]

    reference, _ = results.pop()
    motion = np.linalg.norm(reference - reference[0], axis=2).max()
    errors = [np.linalg.norm(positions - reference, axis=2).max() / motion for positions, _ in results]
    print("substeps    ms/frame    error (% of the motion)")
    for substeps, (_, ms), error in zip(SUBSTEPS, results, errors):
        print(f"{substeps:8} {ms:11.2f} {100 * error:14.3f}")
    if plt is None:
        print("matplotlib is not installed (pip install matplotlib): no plot")
        return
    figure, axes = plt.subplots(figsize=(6, 4))
    times = [ms for _, ms in results]
    axes.loglog(times, 100 * np.array(errors), "o-")
    for substeps, ms, error in zip(SUBSTEPS, times, errors):
        axes.annotate(str(substeps), (ms, 100 * error), textcoords="offset points", xytext=(5, 5))
    axes.set_xlabel("ms/frame")
    axes.set_ylabel("error (% of the motion)")
    axes.set_title("error over time, by substeps")
    figure.tight_layout()
    figure.savefig(arguments.out, dpi=100)
    print(f"plot in {arguments.out}")


if __name__ == "__main__":
    main()
