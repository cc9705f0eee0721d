"""Meshes and the command line that several tests use."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import incise


def box_of_cubes(cells, size):
    """Points and tets of a box: six tets around the diagonal of each cube."""
    nx, ny, nz = cells
    axes = [np.linspace(0.0, s, n + 1) for s, n in zip(size, cells)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def number(i, j, k):
        return (i * (ny + 1) + j) * (nz + 1) + k

    tets = []
    ways = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (1, 0, 2), (2, 1, 0)]
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                for n, way in enumerate(ways):
                    at, corners = [i, j, k], [number(i, j, k)]
                    for axis in way:
                        at[axis] += 1
                        corners.append(number(*at))
                    if n >= 3:  # odd permutations turn the tet inside out
                        corners[2], corners[3] = corners[3], corners[2]
                    tets.append(corners)
    return points, np.array(tets)


def volumes(points, tets):
    """Signed volume of each tet."""
    a, b, c, d = (points[tets[:, i]] for i in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0


@pytest.fixture
def bar():
    """A bar of 1 m along x with a cross section of 0.2 m."""
    return box_of_cubes((10, 2, 2), (1.0, 0.2, 0.2))


@pytest.fixture(scope="session")
def cli():
    """The command line: the file that INCISE_CLI names, or the one in the folder of builds or on the path."""
    named = os.environ.get("INCISE_CLI")
    if named:
        assert Path(named).is_file(), f"INCISE_CLI={named} is no file"
        return named
    root = Path(__file__).resolve().parents[3]
    builds = [root / "target" / profile / "incise" for profile in ("release", "debug")]
    found = next((str(build) for build in builds if build.is_file()), None) or shutil.which("incise")
    if found is None:
        pytest.skip("no `incise` on the path: build it with `cargo build --release`, or set INCISE_CLI")
    return found


@pytest.fixture
def sphere():
    return incise.Mesh.generate("sphere", 300)
