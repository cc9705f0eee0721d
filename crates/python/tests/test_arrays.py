"""What is taken as an array or a mesh, what is refused and how, and what is returned."""

import types

import numpy as np
import pytest

import incise
from conftest import box_of_cubes, volumes


def test_any_memory_layout_is_taken(bar):
    points, tets = bar
    plain = incise.Mesh(points, tets)
    padded = np.zeros((len(points), 6))
    padded[:, ::2] = points
    for other in [
        incise.Mesh(np.asfortranarray(points), np.asfortranarray(tets)),
        incise.Mesh(padded[:, ::2], tets[::-1][::-1].astype(np.uint16)),
        incise.Mesh(points.tolist(), [tuple(tet) for tet in tets.tolist()]),
        incise.Mesh(points.astype(">f8"), tets.astype(">i4")),
    ]:
        assert np.array_equal(other.points, points) and np.array_equal(other.tets, tets)
    assert plain.volume == pytest.approx(volumes(points, tets).sum(), rel=1e-12)
    assert np.array_equal(incise.Mesh(points.astype(np.float32), tets).points, points.astype(np.float32))
    # The input is copied.
    points[0] = 99.0
    assert plain.points[0, 0] == 0.0


def test_outputs_are_read_only_and_stay(bar):
    sim = incise.Simulation(incise.Body(bar), gravity=(0, 0, -9.81))
    before = sim.positions
    assert (before.dtype, before.shape) == (np.float64, (len(bar[0]), 3))
    assert not before.flags.writeable and before.flags.c_contiguous and before.flags.aligned
    with pytest.raises(ValueError, match="read-only"):
        before[0, 0] = 1.0
    copy = before.copy()
    sim.step()
    assert np.array_equal(before, copy) and not np.array_equal(before, sim.positions)
    # The array keeps its memory beyond the simulation.
    del sim
    assert np.array_equal(before, copy)
    assert incise.Mesh(*bar).tets.dtype == np.int64
    assert incise.color([[0, 1]]).colors.dtype == np.int64


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p, t: (p[:, :2], t), r"points has shape \(99, 2\): it must be \(n, 3\)"),
        (lambda p, t: (p.ravel(), t), r"points has shape \(297,\)"),
        (lambda p, t: (p, t[:, :3]), r"tets has shape \(240, 3\): it must be \(n, 4\)"),
        (lambda p, t: (p, t.astype(float)), "tets has dtype float64: it must be whole numbers"),
        (lambda p, t: (p.astype(complex), t), "points has dtype complex128: it must be real numbers"),
        (lambda p, t: (p, np.where(t == 5, -1, t)), r"tets\[0, 3\] is -1: it must be from 0 to 98, the number of a point"),
        (lambda p, t: (p, np.where(t == 98, 99, t)), r"tets\[23\d, \d\] is 99: it must be from 0 to 98"),
        (lambda p, t: (p, t.astype(np.int64) + 2**33), r"is 8589934\d+: it must be from 0 to 98"),
        (lambda p, t: ([[0, 0, 0], [1]], t), "points is not an array"),
        (lambda p, t: (np.array([["a", "b", "c"]]), t), "points has dtype <U1"),
        (lambda p, t: (None, t), "points has dtype object"),
    ],
)
def test_bad_arrays_are_named(bar, change, message):
    points, tets = bar
    tets = tets.copy()
    tets[0] = [0, 13, 4, 5]
    with pytest.raises(ValueError, match=message):
        incise.Mesh(*change(points, tets))


def test_bad_meshes_are_refused_when_a_simulation_is_set_up(bar):
    points, tets = bar
    with pytest.raises(ValueError, match=r"body\[0\].mesh: .*tet 7 has the volume -"):
        incise.Simulation(incise.Body((points, np.vstack([tets[:7], tets[7, [1, 0, 2, 3]], tets[8:]]))))
    with pytest.raises(ValueError, match="no tetrahedra"):
        incise.Simulation(incise.Body((points, np.zeros((0, 4), dtype=int))))
    points = points.copy()
    points[3, 1] = np.nan
    with pytest.raises(ValueError, match="NaN|not finite"):
        incise.Mesh(points, tets).check()
    broken = incise.Mesh(bar[0], np.vstack([tets, tets[:1]]))
    with pytest.raises(ValueError):
        broken.check()
    repaired = broken.repair()
    repaired.check()
    assert len(repaired.tets) == len(tets)


def test_bad_values_have_their_key(bar):
    body = incise.Body(bar)
    for settings, message in [
        ({"solver": {"substep": 3}}, "unknown key or value 'substep': did you mean 'substeps'"),
        ({"solver": {"substeps": "many"}}, "auto"),
        ({"solver": {"time_step": -1.0}}, "time_step is -1"),
        ({"report": ["energie"]}, "energy"),
        ({"gravity": (0, 0)}, r"gravity has shape \(2,\): it must be \(3,\)"),
        ({"ground": {"heigth": 0.0}}, "height"),
        ({"colliders": [{"kind": "sphere", "center": [0, 0, 0]}]}, "radius"),
        ({"threads": 0}, "threads is 0"),
    ]:
        with pytest.raises(ValueError, match=message):
            incise.Simulation(body, **settings)
    with pytest.raises(ValueError, match=r"body\[0\].*poisson"):
        incise.Simulation(incise.Body(bar, poisson_ratio=0.5))
    with pytest.raises(ValueError, match="body is missing"):
        incise.Simulation([])
    with pytest.raises(TypeError, match=r"solver.substeps is a set"):
        incise.Simulation(body, solver={"substeps": {1}})
    with pytest.raises(TypeError):
        incise.Simulation("bar")
    sim = incise.Simulation(body)
    with pytest.raises(ValueError, match="normal"):
        sim.cut_plane((0, 0, 0), (0, 0, 0))
    with pytest.raises(ValueError, match=r"triangles\[0, 2\] is 3"):
        sim.cut_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]])
    for frames in [(3,), (-1, 4), "ab", 3]:
        with pytest.raises(ValueError, match="frames must be a pair"):
            sim.cut_sweep([[0, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 1]], frames)
    with pytest.raises(ValueError, match="blade"):
        sim.begin_stroke([[0, 0, 0]])
    with pytest.raises(ValueError, match="`spher`"):
        sim.punch({"spher": {"center": [0, 0, 0], "radius": 1.0}})
    with pytest.raises(ValueError, match="force"):
        sim.fixed_force(0)
    with pytest.raises(ValueError, match="body is 7"):
        sim.fixed_force(7)
    with pytest.raises(ValueError, match="stroke"):
        sim.end_stroke(5)
    # Nothing of this has changed the simulation.
    assert sim.step()["pieces"] == 1


def test_whole_numbers_out_of_range_are_named(bar):
    body, edges = incise.Body(bar), [[0, 1]]
    sim = incise.Simulation(body)
    surface = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    calls = {
        "threads": lambda n: incise.Simulation(body, threads=n),
        "frames": sim.run,
        "frame": lambda n: sim.cut_plane((0, 0, 0), (1, 0, 0), frame=n),
        "stroke": sim.end_stroke,
        "body": sim.fixed_force,
        "b": lambda n: sim.contact_force(0, n),
        "tets": lambda n: incise.Mesh.tetrahedralize(*surface, n),
        "particles": lambda n: incise.cluster(edges, particles=n),
        "seed": lambda n: incise.color(edges, seed=n),
    }
    for name, call in calls.items():
        with pytest.raises(ValueError, match=f"^{name} is -1: it must not be negative"):
            call(-1)
        with pytest.raises(ValueError, match=f"^{name} is {2**70}: it is too large"):
            call(2**70)
        with pytest.raises(TypeError):
            call("1")
    with pytest.raises(ValueError, match="tets is -5: it must not be negative"):
        incise.Mesh.generate("box", -5)
    with pytest.raises(ValueError, match="solver.substeps is .*: it is too large"):
        incise.Simulation(body, solver={"substeps": 2**70})
    assert sim.run(np.int64(2))[-1]["frame"] == 1


def test_pinned_in_every_form(bar):
    points, tets = bar
    chosen = points[:, 0] > 0.95
    region = {"half_space": {"point": [0.95, 0, 0], "normal": [1, 0, 0]}}
    forms = [chosen, np.flatnonzero(chosen), np.flatnonzero(chosen).tolist(), lambda x: x[:, 0] > 0.95, region, [region]]
    ends = []
    for pinned in forms:
        sim = incise.Simulation(incise.Body(bar, pinned=pinned), gravity=(0, 0, -9.81), solver={"precision": "f64"})
        sim.run(5)
        assert np.array_equal(sim.positions[chosen], points[chosen])
        ends.append(sim.positions)
    assert all(np.array_equal(end, ends[0]) for end in ends)
    for pinned, message in [
        (chosen[:-1], r"pinned has shape \(98,\): it must be \(99,\)"),
        ([0, 99], r"pinned\[1\] is 99"),
        ([-1], r"pinned\[0\] is -1"),
        (np.array([0.0, 1.0]), "pinned has dtype float64"),
        (lambda x: x, r"pinned has (shape|dtype)"),
        ({"half_spac": {}}, "half_space"),
    ]:
        with pytest.raises(ValueError, match=message):
            incise.Body(bar, pinned=pinned)


def test_meshes_of_other_packages(bar):
    points, tets = bar
    meshio = types.SimpleNamespace(points=points, cells_dict={"triangle": tets[:, :3], "tetra": tets})
    vista = types.SimpleNamespace(points=points, cells_dict={np.uint8(10): tets, np.uint8(5): tets[:, :3]})
    for mesh in [meshio, vista]:
        assert np.array_equal(incise.Mesh.wrap(mesh).tets, tets)
        assert incise.Simulation(incise.Body(mesh)).step()["tets"] == len(tets)
    solid = types.SimpleNamespace(points=points, cells_dict={"tetra": tets, "hexahedron8": tets})
    with pytest.raises(ValueError, match="hexahedron8"):
        incise.Mesh.wrap(solid)
    flat = types.SimpleNamespace(points=points, cells_dict={"triangle": tets[:, :3]})
    with pytest.raises(ValueError, match="no tets, only cells of type triangle"):
        incise.Body(flat)
    with pytest.raises(TypeError, match="int is no mesh"):
        incise.Body(3)


def test_meshio(bar, tmp_path):
    meshio = pytest.importorskip("meshio")
    points, tets = bar
    path = tmp_path / "bar.vtk"
    incise.Mesh(points, tets).save(path)
    read = meshio.read(path)
    mesh = incise.Mesh.wrap(read)
    assert np.array_equal(mesh.points, points) and np.array_equal(mesh.tets, tets)


def test_pyvista(bar):
    pyvista = pytest.importorskip("pyvista")
    points, tets = bar
    grid = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: tets}, points)
    mesh = incise.Mesh.wrap(grid)
    assert np.array_equal(mesh.points, points) and np.array_equal(mesh.tets, tets)
    # Read-only arrays are taken back.
    surface = incise.Simulation(incise.Body(mesh)).surface()
    skin = pyvista.PolyData.from_regular_faces(surface.points, surface.triangles)
    assert skin.volume == pytest.approx(mesh.volume, rel=1e-6)


@pytest.mark.parametrize("ending", ["vtk", "vtu", "msh", "mesh", "node"])
def test_files(bar, tmp_path, ending):
    points, tets = bar
    path = tmp_path / f"bar.{ending}"
    incise.Mesh(points, tets).save(path)
    for mesh in [incise.Mesh.load(path), incise.Body(path).mesh, incise.Body(str(path)).mesh]:
        assert np.array_equal(mesh.points, points) and np.array_equal(mesh.tets, tets)
    with pytest.raises(FileNotFoundError, match="absent"):
        incise.Mesh.load(tmp_path / f"absent.{ending}")
    (tmp_path / f"broken.{ending}").write_text("nonsense\n")
    with pytest.raises((ValueError, OSError), match="broken"):
        incise.Mesh.load(tmp_path / f"broken.{ending}")
    with pytest.raises(ValueError, match="format"):
        incise.Mesh(points, tets).save(tmp_path / "bar.xyz")


def test_shapes_and_surfaces():
    ball = incise.Mesh.generate("sphere", 500)
    assert abs(len(ball.tets) - 500) <= 10
    filled = incise.Mesh.tetrahedralize(ball.points, ball.surface(), 2000)
    assert filled.volume == pytest.approx(ball.volume, rel=0.1)
    with pytest.raises(ValueError, match="spher.*`?sphere`?"):
        incise.Mesh.generate("spher", 500)
    with pytest.raises(ValueError):
        incise.Mesh.tetrahedralize(ball.points, ball.surface()[:-1], 2000)
    # A closed surface: each edge has two triangles in opposite directions.
    triangles = ball.surface()
    edges = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    assert {tuple(e) for e in edges.tolist()} == {tuple(e[::-1]) for e in edges.tolist()}


def test_an_empty_mesh_has_empty_arrays():
    mesh = incise.Mesh(np.zeros((0, 3)), np.zeros((0, 4), dtype=int))
    assert mesh.points.shape == (0, 3) and mesh.tets.shape == (0, 4) and mesh.volume == 0.0


def test_boxes_of_the_tests_are_sound():
    for cells in [(1, 1, 1), (2, 3, 4)]:
        points, tets = box_of_cubes(cells, (1.0, 2.0, 3.0))
        assert volumes(points, tets).min() > 0.0
        assert volumes(points, tets).sum() == pytest.approx(6.0)
        incise.Mesh(points, tets).check()
