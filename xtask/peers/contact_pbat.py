"""Run one soft-body contact scene in pbatoolkit (XPBD on the CPU).

contact_pbat.py IN.json OUT.json [recommended|best]

IN.json holds the bodies (tetrahedra), the half-spaces and the material, OUT.json the positions at the end.
pbatoolkit has no planes, so each half-space is a thick fixed box of tetrahedra. "recommended" takes the contact
settings of its own example (xpbd.py), "best" those that penetrated least in a few tries.
"""
import itertools

import numpy as np
from pbatoolkit import pbat, pypbat

import common

# `penalty` multiplies a contact's depth; with `area`, it is per square metre of the vertex's share of the surface.
# Friction of 0.0.11 adds to the slip instead of taking from it, so "best" gives the kinetic coefficient the other
# sign and no static friction: a cube on the floor then stands, where with the signs as documented it runs away.
CHOICES = {
    "recommended": dict(penalty=10.0, area=True, substeps=50, detect=50, friction=lambda mu: (mu, mu)),
    "best": dict(penalty=0.3, area=False, substeps=None, detect=5, friction=lambda mu: (0.0, -mu)),  # the scene's substeps
}


def box(plane, low, high):
    """A box of tetrahedra behind the plane, as wide and as thick as the scene from low to high.

    It has 4 x 4 x 4 cells, because pbatoolkit 0.0.11 can overlook vertices in bodies of a few large tetrahedra.
    """
    normal = common.unit_normal(plane)
    side = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    side /= np.linalg.norm(side)
    size = 2 * np.linalg.norm(high - low)
    center = (low + high) / 2
    center = center - normal * (normal @ (center - plane["point"]))
    grid = np.array(list(itertools.product(range(5), repeat=3)))
    # Off centre, as a vertex just above an edge of the box meets neither of the edge's triangles.
    frame = np.array([side, np.cross(normal, side), normal])
    points = center + size * ((grid / 4 - [0.41, 0.53, 1.0]) @ frame)
    steps = np.array([25, 5, 1])
    tets = [np.cumsum([corner @ steps, *steps[list(order)]])
            for corner in itertools.product(range(4), repeat=3) for order in itertools.permutations(range(3))]
    return points, np.array(tets)


def oriented(points, tets):
    """The tetrahedra with positive volumes, and these volumes."""
    corners = points[tets]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    tets = tets.copy()
    tets[volumes < 0] = tets[volumes < 0][:, [0, 2, 1, 3]]
    return tets, np.abs(volumes)


def prepare(scene, choice="best"):
    """The sentence on the settings, and an iterator over the positions of all bodies after each frame."""
    mu, lam = common.lame(scene)
    bodies = common.bodies(scene)
    every = np.concatenate([p for p, _ in bodies])
    free = len(every)
    parts = bodies + [box(plane, every.min(0), every.max(0)) for plane in scene["planes"]]
    starts = np.concatenate([[0], np.cumsum([len(p) for p, _ in parts])])
    points = np.concatenate([p for p, _ in parts])
    tets, volumes = oriented(points, np.concatenate([t + s for (_, t), s in zip(parts, starts)]))
    mass = np.zeros(len(points))
    np.add.at(mass, tets.ravel(), np.repeat(scene["density"] * volumes / 4, 4))

    use = CHOICES[choice]
    steps = -(-(use["substeps"] or scene["substeps"]) // use["detect"])
    substeps = steps * use["detect"]
    faces = common.surface(tets)
    vertices = np.unique(faces)
    vertices = vertices[vertices < free]  # a fixed vertex gets no response anyway
    share = np.zeros(len(points))
    corners = points[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    np.add.at(share, faces.ravel(), np.repeat(areas / 3, 3))
    penalty = use["penalty"] * (share[vertices] if use["area"] else np.ones(len(vertices)))
    columns = lambda a: np.asfortranarray(a.T)
    begins, order, _ = pypbat.sim.xpbd.partition_mesh_constraints(columns(points), columns(tets))
    gravity = np.tile(np.array(scene["gravity"], float)[:, None], (1, len(points)))
    data = (
        pbat.sim.xpbd.Data()
        .with_volume_mesh(columns(points), columns(tets))
        .with_surface_mesh(vertices, columns(faces))
        .with_bodies(np.repeat(np.arange(len(parts)), np.diff(starts)))
        .with_mass_inverse(1 / mass)
        .with_elastic_material(np.asfortranarray(np.repeat([[mu], [lam]], len(tets), 1)))
        .with_acceleration(np.asfortranarray(gravity))
        .with_collision_penalties(penalty)
        .with_friction_coefficients(*use["friction"](scene["friction"]))
        .with_dirichlet_vertices(np.arange(free, len(points)))
        .with_partitions([int(i) for i in begins], [int(i) for i in order])
        .construct())
    integrator = pbat.sim.xpbd.Integrator(data, 20 * len(points), 160 * len(points))

    def frames():
        for _ in range(scene["frames"]):
            for _ in range(steps):  # a step finds contacts once, whatever its active set update frequency
                integrator.step(scene["time_step"] / steps, 1, use["detect"])
            positions = np.array(integrator.x).T
            yield [positions[a:b] for a, b in zip(starts, starts[1:len(bodies) + 1])]

    settings = (
        f"{choice}: collision penalty {use['penalty']:.3g}{' per square metre of surface' if use['area'] else ''}, no collision "
        f"compliance, static and kinetic friction {use['friction'](scene['friction'])}, {substeps} substeps of 1 iteration, "
        f"contacts found every {use['detect']} substeps; planes are fixed boxes of tetrahedra")
    return settings, frames()


if __name__ == "__main__":
    common.run("contact_pbat", "pbatoolkit 0.0.11, XPBD", prepare)
