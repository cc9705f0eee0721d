"""Coloring and clustering, checked by NumPy alone."""

import numpy as np
import pytest

import incise

ALGORITHMS = [
    "auto", "scgc", "scgc:13", "jones-plassmann", "ecl-gc", "vivace:2", "wlc:64", "mcs", "greedy", "greedy:natural",
    "greedy:random", "dsatur", "iterated-greedy:10", "tabu:1000",
]  # fmt: skip


def cloth(n):
    """Springs of a cloth of n by n particles: along both axes and both diagonals."""
    number = np.arange(n * n).reshape(n, n)
    pairs = [
        (number[:, :-1], number[:, 1:]),
        (number[:-1], number[1:]),
        (number[:-1, :-1], number[1:, 1:]),
        (number[:-1, 1:], number[1:, :-1]),
    ]
    return np.vstack([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in pairs])


def rows(offsets, values):
    """The constraint of each value of CSR."""
    return np.repeat(np.arange(len(offsets) - 1), np.diff(offsets)), np.asarray(values)


def is_proper(offsets, values, colors):
    """Whether no particle has two constraints of one color: pairs of particle and color are unique."""
    constraint, particle = rows(offsets, values)
    pairs = np.stack([particle, np.asarray(colors)[constraint]], axis=1)
    return len(np.unique(pairs, axis=0)) == len(pairs)


def test_the_check_finds_faults():
    assert is_proper([0, 2, 4], [0, 1, 1, 2], [0, 1])
    assert not is_proper([0, 2, 4], [0, 1, 1, 2], [0, 0])
    assert is_proper([0, 2, 4], [0, 1, 2, 3], [0, 0])


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_colorings_are_proper(algorithm):
    rng = np.random.default_rng(7)
    springs = cloth(20)
    sizes = rng.integers(0, 6, 300)
    ragged = np.concatenate([rng.choice(80, size, replace=False) for size in sizes])
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    cases = [
        (springs, (np.arange(0, 2 * len(springs) + 1, 2), springs.ravel())),
        ((offsets, ragged), (offsets, ragged)),
        (np.zeros((0, 2), dtype=int), (np.array([0]), np.array([], dtype=int))),
    ]
    for constraints, csr in cases:
        coloring = incise.color(constraints, algorithm, seed=3)
        assert is_proper(*csr, coloring.colors)
        assert len(coloring) >= coloring.bound
        counts = np.bincount(csr[1]) if len(csr[1]) else np.zeros(1)
        assert coloring.bound == counts.max()
        # Classes are the colors, sorted.
        assert [len(c) for c in coloring.classes] == np.bincount(coloring.colors, minlength=len(coloring)).tolist()
        for color, members in enumerate(coloring.classes):
            assert np.array_equal(members, np.flatnonzero(coloring.colors == color))
        first, members = coloring.csr
        assert np.array_equal(members, np.concatenate([*coloring.classes, []]))
        assert np.array_equal(np.diff(first), [len(c) for c in coloring.classes])


@pytest.mark.parametrize("method", ["none", "serial:10", "serial-loose:5", "greedy-k:6", "pressure:8"])
def test_clusters_are_bounded_and_color_with_fewer_colors(method):
    springs = cloth(24)
    clustering = incise.cluster(springs, method)
    labels = clustering.labels
    sizes = np.bincount(labels, minlength=len(clustering))
    limit = {"none": 1, "serial-loose:5": 6}.get(method) or int(method.split(":")[1])
    assert 1 <= sizes.max() <= limit and len(labels) == len(springs)
    assert np.array_equal(np.concatenate(clustering.classes), np.argsort(labels, kind="stable"))
    # The quotient has the particles of each cluster, once each.
    offsets, values = clustering.quotient
    for cluster in range(len(clustering)):
        own = np.unique(springs[labels == cluster])
        assert np.array_equal(values[offsets[cluster] : offsets[cluster + 1]], own)
    coloring = incise.color(clustering.quotient, balance=True)
    assert is_proper(offsets, values, coloring.colors)
    if method == "serial:10":
        assert len(clustering) < len(springs) / 4
        assert len(coloring) <= len(incise.color(springs))


def test_balance_evens_out_and_adds_no_color():
    springs = cloth(30)
    plain, even = (incise.color(springs, "greedy", balance=balance) for balance in (False, True))
    assert len(plain) == len(even)
    spread = [np.ptp(np.bincount(c.colors)) for c in (plain, even)]
    assert spread[1] <= 1 < spread[0]
    assert is_proper(np.arange(0, 2 * len(springs) + 1, 2), springs.ravel(), even.colors)


def test_sparse_matrices(bar):
    sparse = pytest.importorskip("scipy.sparse")
    tets = bar[1]
    data = np.ones(tets.size)
    matrix = sparse.csr_array((data, tets.ravel(), np.arange(0, tets.size + 1, 4)))
    assert np.array_equal(incise.color(matrix).colors, incise.color(tets).colors)


def test_csr_by_duck_typing(bar):
    class Sparse:
        indptr = np.arange(0, bar[1].size + 1, 4, dtype=np.int32)
        indices = bar[1].ravel().astype(np.int32)

    assert np.array_equal(incise.color(Sparse()).colors, incise.color(bar[1]).colors)


def test_bad_constraints_are_named():
    for constraints, message in [
        ([0, 1, 2], r"1 dimension"),
        ([[0, 1], [1, -2]], r"constraints\[1, 1\] is -2"),
        ([[0.5, 1.0]], "constraints has dtype float64"),
        ([[1, 1]], "constraint 0 .*particle 1"),
        (([0, 2, 1], [0, 1]), "offset"),
        (([0, 2], [0, 1, 2]), "offset"),
        (([1, 2], [0, 1]), "offset"),
        (([0], [0], [0]), "3 parts"),
        (([[0, 1]], [0]), "one dimension"),
    ]:
        with pytest.raises(ValueError, match=message):
            incise.color(constraints)
        with pytest.raises(ValueError, match=message):
            incise.cluster(constraints)
    with pytest.raises(ValueError, match=r"constraints\[0, 1\] is 5: it must be from 0 to 4"):
        incise.color([[0, 5]], particles=5)
    with pytest.raises(ValueError, match="greedi.*greedy"):
        incise.color([[0, 1]], "greedi")
    with pytest.raises(ValueError, match="serial"):
        incise.cluster([[0, 1]], "serail:3")
