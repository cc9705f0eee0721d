"""Snapshots, pickles, threads, and the surface that follows cuts."""

import copy
import multiprocessing
import pickle
import threading
import time
import warnings

import numpy as np
import pytest

import incise

G = (0.0, 0.0, -9.81)


@pytest.fixture
def cut_bar(bar):
    sim = incise.Simulation(incise.Body(bar, pinned=lambda x: x[:, 0] == 0.0), gravity=G)
    sim.cut_sweep([[0.43, -1, 0.5], [0.43, 1, 0.5]], [[0, 0, 0], [0, 0, -1]], (2, 8))
    return sim


def same(one, other):
    return (
        np.array_equal(one.positions, other.positions)
        and np.array_equal(one.tets, other.tets)
        and one.next_frame == other.next_frame
        and one.pieces == other.pieces
    )


def test_snapshots_continue_bit_for_bit(cut_bar):
    cut_bar.run(5)
    before = cut_bar.snapshot()
    read = incise.Snapshot.from_bytes(bytes(before))
    ways = {
        "fork": incise.Simulation.from_snapshot(before),
        "bytes": incise.Simulation.from_snapshot(read),
        "pickled": pickle.loads(pickle.dumps(cut_bar)),
        "pickled snapshot": incise.Simulation.from_snapshot(pickle.loads(pickle.dumps(before))),
        "copied": copy.deepcopy(cut_bar),
    }
    at = cut_bar.positions
    cut_bar.run(10)
    assert cut_bar.report["pieces"] == 2
    for name, other in ways.items():
        assert np.array_equal(other.positions, at), name
        other.run(10)
        assert same(cut_bar, other), name
    end = cut_bar.positions
    cut_bar.restore(before)
    assert np.array_equal(cut_bar.positions, at) and cut_bar.report["pieces"] == 1
    cut_bar.run(10)
    assert np.array_equal(cut_bar.positions, end)


def test_damaged_bytes_are_refused(cut_bar):
    data = bytes(cut_bar.snapshot())
    half = len(data) // 2
    for broken, message in [
        (b"", "not those of a snapshot"),
        (b"PK" + data, "not those of a snapshot"),
        (data[:half], "damaged"),
        (data[:half] + bytes([data[half] ^ 1]) + data[half + 1 :], "damaged"),
        (data + b"\0", "damaged"),
    ]:
        with pytest.raises(ValueError, match=message):
            incise.Snapshot.from_bytes(broken)


def test_meshes_and_bodies_are_pickled(bar):
    body = incise.Body(bar, young_modulus=3e4, pinned=[0, 1, 2], position=(0, 0, 1), substeps=5)
    other = pickle.loads(pickle.dumps(body))
    one, two = (incise.Simulation(b, gravity=G, report=["kappa"]) for b in (body, other))
    one.run(5), two.run(5)
    assert same(one, two)
    assert two.report["bodies"][0]["substeps"] == 5


def test_threads_do_not_change_results(bar):
    ends = []
    for threads in [1, 2, None]:
        sim = incise.Simulation(incise.Body(bar), gravity=G, ground=-0.1, threads=threads)
        sim.cut_plane((0.4, 0, 0), (1, 0, 0), frame=3)
        sim.run(10)
        ends.append(sim.positions)
    assert np.array_equal(ends[0], ends[1]) and np.array_equal(ends[0], ends[2])


def test_other_threads_go_on_while_a_frame_is_computed():
    """A thread that counts milliseconds counts during a long frame, which it could not if the interpreter were held."""
    mesh = incise.Mesh.generate("box", 3000)
    sim = incise.Simulation(incise.Body(mesh), gravity=G, solver={"substeps": 20}, threads=1)
    start = time.perf_counter()
    sim.step()
    once = time.perf_counter() - start
    sim.set_solver({"substeps": max(40, int(20 * 0.5 / once))})
    began, ended = threading.Event(), threading.Event()

    def work():
        began.set()
        sim.step()
        ended.set()

    worker = threading.Thread(target=work)
    worker.start()
    began.wait()
    count = 0
    while not ended.is_set():
        time.sleep(0.001)
        count += 1
    worker.join()
    assert count > 20, f"{count} milliseconds were counted"


def test_calls_from_several_threads_wait_for_each_other(bar):
    sim = incise.Simulation(incise.Body(bar), gravity=G)
    workers = [threading.Thread(target=sim.run, args=(10,)) for _ in range(4)]
    for worker in workers:
        worker.start()
    while any(worker.is_alive() for worker in workers):
        assert np.isfinite(sim.positions).all()
    assert sim.next_frame == 40
    alone = incise.Simulation(incise.Body(bar), gravity=G)
    alone.run(40)
    assert same(sim, alone)


def in_child(mesh):
    """What a process of a pool does: a frame, or the error."""
    try:
        return incise.Simulation(incise.Body(mesh)).step()["tets"]
    except RuntimeError as error:
        return str(error)


def test_processes(bar):
    mesh = incise.Mesh(*bar)
    incise.Simulation(incise.Body(mesh)).step()
    for method in multiprocessing.get_all_start_methods():
        with warnings.catch_warnings():
            # Python warns of forks of a process with threads.
            warnings.simplefilter("ignore", DeprecationWarning)
            with multiprocessing.get_context(method).Pool(1) as pool:
                result = pool.apply_async(in_child, (mesh,)).get(timeout=60)
        # Only a forked process lacks the threads that have been started, and says so in place of waiting for them.
        assert "spawn" in result if method == "fork" else result == len(mesh.tets), method


def within(ranges, count):
    inside = np.zeros(count, dtype=bool)
    for first, end in ranges:
        assert 0 <= first < end <= count
        inside[first:end] = True
    return inside


def test_surface_follows_cuts_by_its_changed_ranges(cut_bar):
    """A copy that is updated in the changed ranges only equals the surface, and a surface made from scratch."""
    surface = cut_bar.surface()
    assert np.array_equal(surface.changed_triangles, [[0, len(surface.triangles)]])
    assert np.array_equal(surface.changed_vertices, [[0, len(surface.particles)]])
    assert surface.outer == len(surface.triangles) and (surface.tags == -1).all()
    again = cut_bar.surface()
    assert again.changed_triangles.shape == (0, 2) and again.changed_vertices.shape == (0, 2)
    triangles, particles = surface.triangles.copy(), surface.particles.copy()
    changes = 0
    for frame in range(12):
        cut_bar.step()
        if frame % 3 == 2:
            continue  # several frames may pass between two calls
        surface = cut_bar.surface()
        new = np.empty_like(surface.triangles)
        kept = min(len(new), len(triangles))
        new[:kept] = triangles[:kept]
        for first, end in surface.changed_triangles:
            new[first:end] = surface.triangles[first:end]
            changes += end - first
        assert within(surface.changed_triangles, len(new))[kept:].all()
        assert np.array_equal(new, surface.triangles)
        moved = np.empty_like(surface.particles)
        moved[: len(particles)] = particles
        for first, end in surface.changed_vertices:
            moved[first:end] = surface.particles[first:end]
        used = np.unique(new)
        assert np.array_equal(moved[used], surface.particles[used])
        triangles, particles = new, surface.particles.copy()
        assert np.array_equal(surface.points, cut_bar.positions[surface.particles])
        # The same triangles as of the mesh, counted by their particles.
        mine = surface.particles[surface.triangles]
        rolled = [np.roll(t, -int(np.argmin(t))).tolist() for t in mine]
        whole = [np.roll(t, -int(np.argmin(t))).tolist() for t in cut_bar.mesh.surface()]
        assert sorted(rolled) == sorted(whole)
    assert 0 < changes and surface.outer < len(surface.triangles)
    assert set(surface.tags[surface.outer :]) == {0} and (surface.tags[: surface.outer] == -1).all()
    lengths = np.linalg.norm(surface.normals[np.unique(surface.triangles)], axis=1)
    np.testing.assert_allclose(lengths, 1.0, atol=1e-9)
    snapshot = cut_bar.snapshot()
    cut_bar.restore(snapshot)
    assert np.array_equal(cut_bar.surface().changed_triangles, [[0, len(surface.triangles)]])


def test_reports_and_settings(bar):
    sim = incise.Simulation(
        incise.Body(bar), gravity=G, report={"every": 2, "quantities": ["energy", "volume", "residual", "kappa", "speed"]}
    )
    first, second = sim.run(2)
    assert {"energy", "volume", "residual", "kappa", "max_speed"} <= set(first)
    assert "energy" not in second and second["cut"] is None
    assert set(first["energy"]) == {"kinetic", "elastic", "gravity"}
    assert sim.report == second
    assert sim.solver["substeps"] == "auto"
    sim.set_solver({"substeps": 3, "method": "gauss-seidel"})
    assert sim.solver["substeps"] == 3 and sim.solver["time_step"] == 0.016
    sim.step()
    assert sim.residuals.shape == (len(bar[1]),)
    with pytest.raises(ValueError, match="substeps"):
        sim.set_solver({"substep": 3})
    assert "240 tets" in repr(sim)
    clusters, colors = sim.partition
    tets = sim.tets
    color = colors[clusters]
    for c in range(color.max() + 1):
        # Two clusters of one color share no particle.
        owner = np.full(len(sim.positions), -1)
        for cluster in np.unique(clusters[color == c]):
            particles = np.unique(tets[clusters == cluster])
            assert (owner[particles] == -1).all()
            owner[particles] = cluster


def test_a_failed_scene_names_its_place(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text('[solver]\nsubstepz = 3\n[[body]]\nshape = { kind = "box", tets = 200 }\n')
    with pytest.raises(ValueError, match=r"scene.toml: line 2: .*substeps"):
        incise.Simulation.from_scene(path)
    path.write_text('[[body]]\nshape = { kind = "box", tets = 200 }\nyoung_modulus = -1.0\n')
    with pytest.raises(ValueError, match=r"scene.toml: line 3: body\[0\].young_modulus"):
        incise.Simulation.from_scene(str(path))
    with pytest.raises(FileNotFoundError, match="absent.toml"):
        incise.Simulation.from_scene(tmp_path / "absent.toml")
    with pytest.raises(FileNotFoundError, match="absent.vtk"):
        incise.Simulation.from_scene({"body": [{"mesh": "absent.vtk"}]})


def test_scenes_are_dictionaries(tmp_path):
    scene = incise.built_in_scene()
    assert scene["body"] and scene["stroke"]
    scene["body"][0]["shape"]["tets"] = np.int64(1000)
    path = tmp_path / "scene.toml"
    path.write_text(incise.scene_to_toml(scene))
    one, two = incise.Simulation.from_scene(scene), incise.Simulation.from_scene(path)
    three = incise.Simulation.from_toml(path.read_text(), threads=1)
    assert incise.load_scene(path)["body"][0]["shape"]["tets"] == 1000
    for sim in (one, two, three):
        sim.run(6)
    assert same(one, two) and same(one, three)
    with pytest.raises(ValueError, match="bodi"):
        incise.Simulation.from_scene({"bodies": []})


def test_advise():
    scene = {
        "world": {"gravity": G},
        "body": [
            {
                "shape": {"kind": "beam", "tets": 250},
                "fixed": [{"half_space": {"point": [-0.45, 0, 0], "normal": [-1, 0, 0]}}],
            }
        ],
    }
    advice = incise.advise(scene, 1000.0, frames=2)
    best = advice["measured"][advice["best"]]
    assert best["ms"] <= 1000.0 and best["error"]["largest"] < 1.0
    assert [row["ms"] for row in advice["measured"]] == sorted(row["ms"] for row in advice["measured"])
    # The settings are ready to use.
    scene["solver"] = best["settings"]
    incise.Simulation.from_scene(scene).step()
    with pytest.raises(ValueError, match="budget-ms is -1"):
        incise.advise(scene, -1.0)
