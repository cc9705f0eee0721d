"""Run one soft-body contact scene in NVIDIA Newton (SolverVBD on the CPU).

contact_newton.py IN.json OUT.json [recommended|best]

IN.json holds the bodies (tetrahedra), the half-spaces and the material, OUT.json the positions at the end.
"recommended" takes the contact settings of Newton's own examples of soft bodies (softbody_gift), scaled to the
mesh; "best" takes those that penetrated least in a few tries. Newton wants bodies apart at the start, so each is
raised by the contact distance times half plus the height of its centroid in its own heights.
"""
import json
import sys

import numpy as np
import warp as wp

wp.config.quiet = True
import newton

# Distances in mean edges of the surfaces, stiffness in units of the shear modulus times one metre.
CHOICES = {
    "recommended": dict(margin=0.04, stiffness=0.5, substeps=10, iterations=15, epsilon=1e-2),
    "best": dict(margin=0.04, stiffness=0.5, substeps=None, iterations=5, epsilon=1e-3),  # the scene's substeps
}


def mean_edge(bodies):
    """Mean edge length of the surface triangles of all bodies."""
    lengths = []
    for points, tets in bodies:
        faces = np.concatenate([np.delete(tets, corner, 1) for corner in range(4)])
        _, inverse, count = np.unique(np.sort(faces, 1), axis=0, return_inverse=True, return_counts=True)
        corners = points[faces[count[inverse.ravel()] == 1]]
        lengths.append(np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2).mean())
    return float(np.mean(lengths))


def prepare(scene, choice="best"):
    """The sentence on the settings, and an iterator over the positions of all bodies after each frame."""
    young, poisson = scene["young_modulus"], scene["poisson_ratio"]
    mu, lam = young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    bodies = [(np.array(b["positions"], float), np.array(b["tets"], int)) for b in scene["bodies"]]
    use = CHOICES[choice]
    substeps = use["substeps"] or scene["substeps"] + scene["substeps"] % 2  # even, see frames()
    margin = use["margin"] * mean_edge(bodies)
    gap, stiffness, damping = margin / 2, use["stiffness"] * mu, 1e-5 * mu

    builder = newton.ModelBuilder(gravity=tuple(scene["gravity"]))
    surface = newton.ModelBuilder.ShapeConfig(ke=stiffness, kd=damping, mu=scene["friction"])
    for plane in scene["planes"]:
        normal = np.array(plane["normal"], float) / np.linalg.norm(plane["normal"])
        offset = -float(normal @ plane["point"])
        builder.add_shape_plane((*map(float, normal), offset), width=0.0, length=0.0, cfg=surface)
    starts = [0]
    for points, tets in bodies:
        raised = margin * (0.5 + points[:, 2].mean() / np.ptp(points[:, 2]))
        builder.add_soft_mesh(
            pos=(0.0, 0.0, raised), rot=wp.quat_identity(), scale=1.0, vel=(0.0, 0.0, 0.0),
            vertices=[wp.vec3(*p) for p in points], indices=tets.ravel().tolist(), density=scene["density"],
            k_mu=mu, k_lambda=lam, k_damp=damping, particle_radius=margin)
        starts.append(starts[-1] + len(points))
    builder.color()
    model = builder.finalize(device="cpu")
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = stiffness, damping, scene["friction"]
    solver = newton.solvers.SolverVBD(
        model, iterations=use["iterations"], friction_epsilon=use["epsilon"], particle_enable_self_contact=True,
        particle_self_contact_margin=margin, particle_self_contact_gap=gap)
    pipeline = newton.CollisionPipeline(model, soft_contact_gap=gap)
    contacts = pipeline.contacts()

    def frames():
        state, other, control = model.state(), model.state(), model.control()
        with wp.ScopedCapture(device="cpu") as capture:  # an even number of substeps ends in `state` again
            for step in range(substeps):
                now, then = (state, other) if step % 2 == 0 else (other, state)
                now.clear_forces()
                pipeline.collide(now, contacts)
                solver.step(now, then, control, contacts, scene["time_step"] / substeps)
        for _ in range(scene["frames"]):
            wp.capture_launch(capture.graph)
            positions = state.particle_q.numpy().astype(float)
            yield [positions[a:b] for a, b in zip(starts, starts[1:])]

    settings = (
        f"{choice}: self-contact margin and particle radius {margin * 1e3:.3g} mm ({100 * use['margin']:.3g}% of the mean "
        f"edge), gap {gap * 1e3:.3g} mm, contact stiffness {stiffness:.3g} N/m, damping {damping:.3g}, "
        f"{substeps} substeps of {use['iterations']} iterations, friction threshold {use['epsilon']:.3g} m/s; bodies start apart by the "
        "margin; planes are Newton's own")
    return settings, frames()


def main():
    scene = json.load(open(sys.argv[1]))
    settings, frames = prepare(scene, *sys.argv[3:4])
    for positions in frames:
        pass
    if not all(np.isfinite(p).all() for p in positions):
        raise ValueError("the positions are not finite")
    json.dump({
        "system": f"Newton {newton.__version__}, VBD (Warp {wp.__version__}, CPU)", "settings": settings,
        "positions": [p.tolist() for p in positions]}, open(sys.argv[2], "w"))


if __name__ == "__main__":
    try:
        main()
    except Exception as error:
        sys.exit(f"contact_newton: {' '.join(str(error).split()) or type(error).__name__}")
