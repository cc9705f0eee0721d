"""Cuts a mesh with a moving blade and shows it in PyVista.

    python cut_and_show.py [MESH] [--frames N] [--out FILE.png]

MESH is a file that incise or PyVista reads; without one a liver is generated. With a display a window opens; without one,
or with --out, a picture is written. Without PyVista the body is written as a .vtk file, which ParaView opens.
"""

import argparse
import os
import sys

import numpy as np

import incise

try:
    import pyvista
except ImportError:
    pyvista = None


def body_of(path):
    """The body, held at its left side, and the box around it."""
    mesh = incise.Mesh.load(path) if path else incise.Mesh.generate("liver", 4000)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    held = low[0] + 0.15 * (high[0] - low[0])
    return incise.Body(mesh, young_modulus=6e4, damping=0.02, pinned=lambda x: x[:, 0] < held), low, high


def simulate(path, frames):
    """Slices the body at two thirds of its length, from top to bottom, in half of the frames."""
    body, low, high = body_of(path)
    size = high - low
    floor = low[2] - 0.15 * size[2]
    sim = incise.Simulation(body, gravity=(0, 0, -9.81), ground={"height": floor, "friction": 0.5})
    x = low[0] + 0.65 * size[0]
    y = [low[1] - size[1], high[1] + size[1]]
    blade = np.array([[x, y[0], high[2] + 0.1 * size[2]], [x, y[1], high[2] + 0.1 * size[2]]])
    stroke = sim.begin_stroke(blade)
    for frame in range(frames):
        if frame <= frames // 2:
            way = 1.4 * size[2] * frame / (frames // 2)
            sim.move_blade(stroke, blade - [0, 0, way])
        if frame == frames // 2:
            sim.end_stroke(stroke)
        report = sim.step()
        for event in sim.events:
            if event["kind"] == "piece_detached":
                print(f"frame {frame}: a piece of {event['volume']:.3g} m³ comes off")
        for warning in report.get("warnings", []):
            print(f"frame {frame}: {warning['message']}")
    return sim


def show(sim, out):
    """Draws the outer surface and the cut faces in two colors."""
    surface = sim.surface()
    plotter = pyvista.Plotter(off_screen=out is not None, window_size=(1000, 700))
    for part, color in [(surface.triangles[: surface.outer], "indianred"), (surface.triangles[surface.outer :], "mistyrose")]:
        if len(part):
            plotter.add_mesh(pyvista.PolyData.from_regular_faces(surface.points, part), color=color, smooth_shading=False)
    plotter.camera_position = "xz"
    plotter.camera.azimuth, plotter.camera.elevation = 20, 20
    if out is None:
        plotter.show()
    else:
        plotter.screenshot(out)
        print(f"picture in {out}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mesh", nargs="?", help="mesh file; without one a liver is generated")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--out", help="write a picture to this .png file")
    arguments = parser.parse_args()
    sim = simulate(arguments.mesh, arguments.frames)
    for piece in sim.pieces:
        print(f"piece {piece['id']}: {piece['tets']} tets, {piece['mass']:.3g} kg")
    if pyvista is None:
        out = os.path.splitext(arguments.out or "cut.vtk")[0] + ".vtk"
        incise.Mesh(sim.positions, sim.tets).save(out)
        print(f"PyVista is not installed (pip install pyvista): the cut body is in {out}, which ParaView opens")
        return
    has_display = sys.platform in ("win32", "darwin") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    out = arguments.out or (None if has_display else "cut.png")
    show(sim, out)


if __name__ == "__main__":
    main()
