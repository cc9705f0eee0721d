"""Motion against closed forms, and what a cut conserves."""

import numpy as np
import pytest

import incise
from conftest import box_of_cubes, volumes

G = 9.81


def f64(substeps):
    return {"method": "gauss-seidel", "substeps": substeps, "precision": "f64"}


@pytest.mark.parametrize("substeps", [1, 4, 16])
def test_free_fall(substeps):
    """Symplectic Euler falls g t (t + dt) / 2, which is the parabola to first order in the substep dt."""
    points, tets = box_of_cubes((2, 2, 2), (0.3, 0.3, 0.3))
    sim = incise.Simulation(incise.Body((points, tets)), gravity=(0, -G, 0), solver=f64(substeps))
    frames = 25
    reports = sim.run(frames)
    t = frames * sim.time_step
    assert reports[-1]["time_s"] == pytest.approx(t, rel=1e-12)
    dt = sim.time_step / substeps
    np.testing.assert_allclose(sim.velocities[:, 1], -G * t, rtol=1e-9)
    fall = sim.positions - points
    np.testing.assert_allclose(fall[:, 1], -G * t * (t + dt) / 2, rtol=1e-9)
    np.testing.assert_allclose(fall[:, [0, 2]], 0.0, atol=1e-12)
    # The distance to the parabola is that of the order, and no more.
    assert abs(fall[:, 1] + G * t * t / 2).max() == pytest.approx(G * t * dt / 2, rel=1e-6)


def test_throw_and_spin(bar):
    points, tets = bar
    sim = incise.Simulation(incise.Body((points, tets)), solver=f64(1))
    sim.set_velocities((2.0, 0.0, -1.0))
    sim.run(10)
    t = 10 * sim.time_step
    np.testing.assert_allclose(sim.positions, points + t * np.array([2.0, 0.0, -1.0]), atol=1e-9)
    assert sim.velocities.shape == points.shape and not sim.velocities.flags.writeable
    np.testing.assert_allclose(sim.velocities, np.tile([2.0, 0.0, -1.0], (len(points), 1)), atol=1e-9)
    # A spin about the center leaves the center of mass where it is.
    sim = incise.Simulation(incise.Body((points, tets), young_modulus=1e6), solver=f64(20))
    center = np.array([0.5, 0.1, 0.1])
    sim.set_velocities((0, 0, 0), angular=(0, 0, 1.0), center=center)
    sim.run(5)
    mass = np.zeros(len(points))
    np.add.at(mass, tets.ravel(), np.repeat(volumes(points, tets), 4) / 4)
    np.testing.assert_allclose(mass @ sim.positions / mass.sum(), center, atol=1e-9)
    np.testing.assert_allclose(sim.masses, 1000.0 * mass, rtol=1e-12)
    assert sim.positions[-1, 1] > points[-1, 1]


def test_weight_on_what_is_pinned():
    """At rest, what a pinned end bears is the weight of the bar: rho g times 0.4 m by 0.2 m by 0.2 m."""
    bar = box_of_cubes((4, 2, 2), (0.4, 0.2, 0.2))
    body = incise.Body(bar, young_modulus=2e6, damping=0.1, pinned=lambda x: x[:, 0] == 0.0)
    sim = incise.Simulation(body, gravity=(0, 0, -G), report=["force", "energy"], solver=f64(20))
    sim.run(100)
    assert sim.report["energy"]["kinetic"] < 1e-15
    weight = 1000.0 * 0.016 * G
    np.testing.assert_allclose(sim.fixed_force(0)["force"], [0, 0, -weight], rtol=1e-8, atol=1e-6)


def test_sag_is_that_of_the_scene():
    """A bar by arrays and by the keys of a scene moves bit for bit alike, and sags about as a cantilever does."""
    settings = {"substeps": 20, "precision": "f64", "method": "gauss-seidel"}
    mesh = incise.Mesh.generate("beam", 1000)
    low = mesh.points[:, 0].min() + 0.02
    region = {"half_space": {"point": [low, 0, 0], "normal": [-1, 0, 0]}}
    body = incise.Body(mesh, young_modulus=4e6, damping=0.05, pinned=region)
    one = incise.Simulation(body, gravity=(0, 0, -G), solver=settings)
    scene = {
        "world": {"gravity": [0, 0, -G]},
        "solver": settings,
        "body": [
            {"shape": {"kind": "beam", "tets": 1000}, "young_modulus": 4e6, "damping": 0.05, "fixed": [region]}
        ],
    }
    other = incise.Simulation.from_scene(scene)
    for _ in range(3):
        one.run(20), other.run(20)
        assert np.array_equal(one.positions, other.positions)
    by_points = incise.Simulation(
        incise.Body(mesh, young_modulus=4e6, damping=0.05, pinned=np.flatnonzero(mesh.points[:, 0] <= low)),
        gravity=(0, 0, -G),
        solver=settings,
    )
    by_points.run(60)
    assert np.array_equal(one.positions, by_points.positions)
    # Euler and Bernoulli: rho g A L^4 / (8 E I), for a mesh that is coarse and therefore stiffer.
    size = np.ptp(mesh.points, axis=0)
    length, height = size[0] - 0.02, size[2]
    sag = 1000.0 * G * 12.0 / (8.0 * 4e6 * height**2) * length**4
    tip = np.argmax(mesh.points[:, 0])
    measured = mesh.points[tip, 2] - one.positions[tip, 2]
    assert 0.5 * sag < measured < 1.2 * sag


@pytest.mark.parametrize("snap", [0.0, 0.1])
def test_cut_conserves_volume_and_mass(bar, snap):
    points, tets = bar
    whole = volumes(points, tets).sum()
    assert whole == pytest.approx(0.04, rel=1e-12)
    sim = incise.Simulation(incise.Body((points, tets), density=800.0), solver=f64(1))
    sim.cut_plane((0.437, 0.1, 0.1), (1.0, 0.1, -0.05), snap=snap)
    report = sim.step()
    assert report["cut"]["tets_cut"] > 0 and report["pieces"] == 2
    mesh = sim.mesh
    now = volumes(mesh.points, mesh.tets)
    assert now.min() > 0.0
    assert now.sum() == pytest.approx(whole, rel=1e-12)
    pieces = sim.pieces
    assert sum(piece["mass"] for piece in pieces) == pytest.approx(800.0 * whole, rel=1e-12)
    # Each piece by itself, and its volume from the plane: the mean length along x.
    numbers = sim.piece_numbers
    for piece in pieces:
        own = now[numbers == piece["id"]]
        assert own.size == piece["tets"]
        assert own.sum() == pytest.approx(piece["volume"], rel=1e-12)
    if snap == 0.0:
        left = min(pieces, key=lambda piece: mesh.points[mesh.tets[numbers == piece["id"]]][..., 0].mean())
        assert left["volume"] == pytest.approx(0.437 * 0.04, rel=1e-9)
    sim.check()
    # No particle is shared by two pieces.
    owners = [set(mesh.tets[numbers == piece["id"]].ravel()) for piece in pieces]
    assert not owners[0] & owners[1]


def test_all_kinds_of_cuts(bar):
    body = incise.Body(bar)
    sim = incise.Simulation(body)
    sim.cut_sweep([[0.25, -1, 0.5], [0.25, 1, 0.5]], [[0, 0, 0], [0, 0, -1]], (0, 4))
    square = np.array([[0.55, -1, -1], [0.55, 1, -1], [0.55, 1, 1], [0.55, -1, 1]], dtype=np.float32)
    sim.cut_triangles(square, [[0, 1, 2], [0, 2, 3]], frame=6)
    sim.cut({"kind": "rectangle", "frame": 7, "center": [0.75, 0, 0], "half_u": [0, 1, 0], "half_v": [0, 0, 1]})
    reports = sim.run(8)
    assert [report["pieces"] for report in reports[-3:]] == [2, 3, 4]
    events = sim.events
    assert [event["kind"] for event in events] == ["cut_began", "piece_detached", "cut_ended"]
    assert events[1]["volume"] > 0.0
    before = sim.report["tets"]
    sim.remove({"box": {"low": [0.8, -1, -1], "high": [2, 1, 1]}})
    sim.punch({"sphere": {"center": [0.4, 0.1, 0.1], "radius": 0.07}})
    report = sim.step()
    assert report["cut"]["tets_removed"] > 0 and report["pieces"] == 5
    assert report["tets"] != before
    sim.check()


def test_live_blade_equals_the_sweep(bar):
    """A live blade with the poses of a sweep cuts bit for bit alike."""
    solver = {"substeps": 4, "precision": "f64"}
    body = incise.Body(bar, pinned=lambda x: x[:, 0] == 0.0)
    sweep, live = (incise.Simulation(body, gravity=(0, 0, -G), solver=solver) for _ in range(2))
    blade = np.array([[0.43, -1.0, 0.5], [0.43, 1.0, 0.5]])
    sweep.cut_sweep(blade, [[0, 0, 0], [0, 0, -1.0]], (0, 8))
    stroke = live.begin_stroke(blade)
    for frame in range(9):
        live.move_blade(stroke, blade + [0, 0, -1.0 * (frame / 8)])
        live.step()
        sweep.step()
    live.end_stroke(stroke)
    assert live.report["pieces"] == 2
    assert np.array_equal(live.positions, sweep.positions)
    assert np.array_equal(live.tets, sweep.tets)
    with pytest.raises(ValueError, match="stroke"):
        live.move_blade(stroke, blade)


def test_grab_pulls_and_feels(sphere):
    sim = incise.Simulation(incise.Body(sphere), report=["force"], solver={"precision": "f64"})
    top = sphere.points[np.argmax(sphere.points[:, 2])]
    grab = sim.grab(top, 0.1, compliance=1e-3)
    sim.move_grab(grab, top + [0, 0, 0.02])
    sim.step()
    assert sim.grab_force(grab)["force"][2] < 0.0
    assert sim.grab_force(grab)["force"].shape == (3,)
    sim.release(grab)
    with pytest.raises(ValueError, match="grab"):
        sim.release(grab)
    assert sim.grab((50, 50, 50), 0.1) is None
    # A rigid grab carries its particles all the way.
    grab = sim.grab(sim.positions[0], 0.01)
    target = sim.positions[0] + [0.05, 0, 0]
    for step in range(1, 6):
        sim.move_grab(grab, sim.positions[0] * (1 - step / 5) + target * (step / 5))
        sim.step()
    np.testing.assert_allclose(sim.positions[0], target, atol=1e-6)


def test_contact_bears_the_weight():
    """A box at rest on a wider one, and both on the ground: each contact bears the weight above it."""
    lower, upper = box_of_cubes((3, 3, 1), (0.6, 0.6, 0.2)), box_of_cubes((2, 2, 2), (0.3, 0.3, 0.3))
    bodies = [
        incise.Body(lower, position=(-0.3, -0.3, 0.0), young_modulus=1e6, damping=0.05),
        incise.Body(upper, position=(-0.15, -0.15, 0.2), young_modulus=1e6, damping=0.05),
    ]
    ground = {"height": 0.0, "friction": 0.5}
    sim = incise.Simulation(bodies, gravity=(0, 0, -G), ground=ground, contact=True, report=["force"])
    sim.run(200)
    above, both = 1000.0 * 0.027 * G, 1000.0 * (0.027 + 0.072) * G
    assert sim.contact_force(1, 0)["force"][2] == pytest.approx(above, rel=0.05)
    assert sim.contact_force(0, 1)["force"][2] == pytest.approx(-above, rel=0.05)
    assert sim.ground_force()["force"][2] == pytest.approx(-both, rel=0.05)
    assert {tuple(contact["bodies"]) for contact in sim.contacts} == {(0, 1)}
    kinds = {force["kind"] for force in sim.report["forces"]}
    assert {"ground", "contact"} <= kinds


def test_bodies_obstacles_and_held_parts_change_between_frames(sphere):
    sim = incise.Simulation(incise.Body(sphere), gravity=(0, 0, -G), solver={"precision": "f64"})
    ball = sim.add_collider({"kind": "sphere", "center": [0, 0, -2], "radius": 0.5, "friction": 0.2})
    assert sim.colliders == [ball]
    sim.move_collider(ball, (0, 0, -1.5))
    other = sim.add_body(incise.Body(sphere, position=(3, 0, 0)))
    assert (other, sim.bodies) == (1, [0, 1])
    top = {"half_space": {"point": [3, 0, 0.4], "normal": [0, 0, 1]}}
    held = sim.add_attachment({"body": 1, "regions": [top]})
    sim.set_report(["force"])
    sim.move_attachment(held, (0, 0, 0.01), rotation=(0, 0, 0, 1))
    assert sim.step()["pieces"] == 2
    np.testing.assert_allclose(sim.collider_position(ball), (0, 0, -1.5))
    assert sim.attachment_force(held)["force"][2] < 0.0
    string = sim.add_distance({"from": {"body": 0, "point": [0.5, 0, 0]}, "to": {"body": 1, "point": [2.5, 0, 0]}})
    sim.set_distance(string, 1.9, compliance=1e-5)
    sim.step()
    sim.remove_distance(string)
    sim.set_attachment_compliance(held, 1e-4)
    sim.remove_attachment(held)
    sim.remove_collider(ball)
    sim.remove_body(other)
    assert sim.step()["pieces"] == 1 and sim.bodies == [0]
    sim.set_gravity(None)
    assert sim.apply_impulse((0, 0, sim.positions[:, 2].max()), 0.3, (0, 0, 1.0))
    hit = sim.ray_cast((0.01, 0.02, 9.0), (0, 0, -1.0))
    assert hit["tag"] == -1 and hit["normal"][2] > 0.5 and len(hit["particles"]) == 3
    assert sim.ray_cast((9, 9, 9), (1, 0, 0)) is None
