"""Run one soft-body contact scene in NVIDIA Newton (SolverVBD on the CPU).

contact_newton.py IN.json OUT.json [recommended|best]

IN.json holds the bodies (tetrahedra), the half-spaces and the material, OUT.json the positions at the end.
"recommended" takes the contact settings of Newton's own examples of soft bodies (softbody_gift), scaled to the
mesh; "best" takes those that penetrated least in a few tries. Newton wants bodies apart at the start, so each is
raised by the contact distance times half plus the height of its centroid in its own heights.
"""
import numpy as np
import warp as wp

wp.config.quiet = True
import newton

import common

# Distances in mean edges of the surfaces, stiffness in units of the shear modulus times one metre.
CHOICES = {
    "recommended": dict(margin=0.04, stiffness=0.5, substeps=10, iterations=15, epsilon=1e-2),
    "best": dict(margin=0.04, stiffness=0.5, substeps=None, iterations=5, epsilon=1e-3),  # the scene's substeps
}


def mean_edge(bodies):
    """Mean edge length of the surface triangles of all bodies."""
    lengths = []
    for points, tets in bodies:
        corners = points[common.surface(tets)]
        lengths.append(np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2).mean())
    return float(np.mean(lengths))


def prepare(scene, choice="best"):
    """The sentence on the settings, and an iterator over the positions of all bodies after each frame."""
    mu, lam = common.lame(scene)
    bodies = common.bodies(scene)
    use = CHOICES[choice]
    substeps = use["substeps"] or scene["substeps"] + scene["substeps"] % 2  # even, see frames()
    margin = use["margin"] * mean_edge(bodies)
    gap, stiffness, damping = margin / 2, use["stiffness"] * mu, 1e-5 * mu

    builder = newton.ModelBuilder(gravity=tuple(scene["gravity"]))
    surface = newton.ModelBuilder.ShapeConfig(ke=stiffness, kd=damping, mu=scene["friction"])
    for plane in scene["planes"]:
        normal = common.unit_normal(plane)
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


if __name__ == "__main__":
    common.run("contact_newton", f"Newton {newton.__version__}, VBD (Warp {wp.__version__}, CPU)", prepare)
