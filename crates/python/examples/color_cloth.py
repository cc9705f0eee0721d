"""Colors the springs of a cloth and solves them color by color with NumPy.

    python color_cloth.py [N] [--frames N] [--out FILE.png]

Springs of one color share no particle, so a whole class is one vectorized update, without atomics or a loop over springs.
The cloth of N by N particles hangs from two corners. Without matplotlib no picture is drawn.
"""

import argparse
import time

import numpy as np

import incise

try:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
except ImportError:
    plt = None

GRAVITY = np.array([0.0, 0.0, -9.81])


def cloth(n):
    """Particles on a square of 1 m, springs along both axes and both diagonals."""
    side = np.linspace(0.0, 1.0, n)
    points = np.stack(np.meshgrid(side, side, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(n * n).reshape(n, n)
    pairs = [
        (number[:, :-1], number[:, 1:]),
        (number[:-1], number[1:]),
        (number[:-1, :-1], number[1:, 1:]),
        (number[:-1, 1:], number[1:, :-1]),
    ]
    springs = np.vstack([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in pairs])
    return points, springs


def solve(x, springs, lengths, weights, classes):
    """One Gauss-Seidel pass: the springs of a class at a time, each moved to its rest length."""
    for members in classes:
        a, b = springs[members].T
        difference = x[b] - x[a]
        length = np.linalg.norm(difference, axis=1)
        w = weights[a] + weights[b]
        correction = ((length - lengths[members]) / (length * np.maximum(w, 1e-30)))[:, None] * difference
        # No particle occurs twice in a class: assignment with arrays of numbers is safe.
        x[a] += weights[a, None] * correction
        x[b] -= weights[b, None] * correction


def simulate(points, springs, classes, frames, substeps=25, time_step=0.016):
    x, v = points.copy(), np.zeros_like(points)
    n = int(np.sqrt(len(points)))
    weights = np.ones(len(points))
    weights[[0, n * (n - 1)]] = 0.0  # two corners are held
    lengths = np.linalg.norm(x[springs[:, 1]] - x[springs[:, 0]], axis=1)
    dt = time_step / substeps
    for _ in range(frames * substeps):
        before = x.copy()
        v[weights > 0] += dt * GRAVITY
        x += dt * v
        x[weights == 0] = before[weights == 0]
        solve(x, springs, lengths, weights, classes)
        v = (x - before) / dt
    stretch = np.linalg.norm(x[springs[:, 1]] - x[springs[:, 0]], axis=1) / lengths
    return x, stretch


def draw(x, springs, coloring, out):
    figure = plt.figure(figsize=(10, 5))
    rest = figure.add_subplot(1, 2, 1)
    n = int(np.sqrt(len(x)))
    rest.set_title(f"{len(springs)} springs in {len(coloring)} colors")
    part = springs[(springs % n < 8).all(axis=1) & (springs // n < 8).all(axis=1)]
    colors = coloring.colors[(springs % n < 8).all(axis=1) & (springs // n < 8).all(axis=1)]
    for (a, b), color in zip(part, colors):
        rest.plot([a // n, b // n], [a % n, b % n], color=plt.cm.tab20(color % 20), linewidth=2)
    rest.set_aspect("equal")
    rest.set_axis_off()
    hanging = figure.add_subplot(1, 2, 2, projection="3d")
    hanging.plot_surface(*(x[:, i].reshape(n, n) for i in range(3)), color="lightsteelblue", linewidth=0)
    figure.savefig(out, dpi=100)
    print(f"picture in {out}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("n", nargs="?", type=int, default=30)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--out", default="cloth.png", help="picture, a .png file")
    arguments = parser.parse_args()
    points, springs = cloth(arguments.n)
    for algorithm in ["auto", "scgc", "vivace", "greedy", "dsatur"]:
        start = time.perf_counter()
        coloring = incise.color(springs, algorithm)
        ms = 1e3 * (time.perf_counter() - start)
        sizes = [len(members) for members in coloring.classes]
        print(f"{algorithm:8} {len(coloring):3} colors (at least {coloring.bound}), classes of {min(sizes)} to {max(sizes)}, {ms:.1f} ms")
    coloring = incise.color(springs, balance=True)
    clusters = incise.cluster(springs, "serial:10")
    print(f"{len(clusters)} clusters of up to 10 springs need {len(incise.color(clusters.quotient))} colors")
    x, stretch = simulate(points, springs, coloring.classes, arguments.frames)
    print(f"after {arguments.frames} frames: lowest point {x[:, 2].min():.3f} m, largest stretch {stretch.max():.3f}")
    if plt is None:
        print("matplotlib is not installed (pip install matplotlib): no picture")
    else:
        draw(x, springs, coloring, arguments.out)


if __name__ == "__main__":
    main()
