import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.mapping import tables

from scenefw.core.errors import ConfigError, InputError
from scenefw.mapping.semantic_fusion import SemanticFusion


def distributions(frame, classes, seed=0, sharpness=0.3):
    rng = np.random.default_rng(seed)
    values = rng.dirichlet(np.full(classes, sharpness), frame.depth.shape)
    return np.moveaxis(values, -1, 0).astype(np.float32)


def certain(frame, label, classes=4):
    probabilities = np.zeros((classes, *frame.depth.shape), np.float32)
    probabilities[label] = 1
    return probabilities


def reference(frames, labels, grid, alpha, floor, power):
    """Eqs 4.5 to 4.10 pixel by pixel, as printed but for the floor and the coefficient."""
    classes = len(labels[0])
    a, b = (classes - 1) / classes, 1 / classes
    logs = np.zeros((classes, grid.vertices**2))
    positions = grid.positions().reshape(-1, 2)
    for frame, probabilities in zip(frames, labels, strict=True):
        measured = np.moveaxis(probabilities, 0, -1)[frame.depth > 0]
        eye = frame.camera.T_world_camera[:3, 3]
        for point, m in zip(tables.points(frame), measured, strict=True):
            found = tables.triangle(grid, point[:2])
            if found is None:
                continue
            ray = point - eye
            weight = (abs(ray[2]) / np.linalg.norm(ray)) ** power
            for vertex, coefficient in zip(*found, strict=True):
                d = np.linalg.norm(point[:2] - positions[vertex]) / grid.spacing
                same = np.exp(-alpha * d) * a + b
                other = (1 - np.exp(-alpha * d) * a - b) / (classes - 1)
                likelihood = same * m + other * (m.sum() - m)
                likelihood = floor + (1 - classes * floor) * likelihood
                logs[:, vertex] += weight * coefficient * np.log(likelihood)
    exponentials = np.exp(logs - logs.max(axis=0))
    return (exponentials / exponentials.sum(axis=0)).reshape(classes, *grid.shape), logs


@pytest.mark.parametrize(
    ("alpha", "floor", "power"), [(1.0, 1e-3, 0.0), (0.0, 0.05, 0.0), (3.0, 1e-4, 2.0)]
)
def test_probabilities_are_those_of_the_equations(alpha, floor, power):
    frames = [tables.boxes(view) for view in tables.views(3, width=40, rows=30)]
    labels = [distributions(frame, 3, seed) for seed, frame in enumerate(frames)]
    running = SemanticFusion(alpha, floor, power).begin(tables.SMALL, 3)
    for frame, probabilities in zip(frames, labels, strict=True):
        running.add(probabilities, frame)
    expected, _ = reference(frames, labels, tables.SMALL, alpha, floor, power)
    assert (np.abs(expected - 1 / 3).max(axis=0) > 0.1).mean() > 0.2
    np.testing.assert_allclose(running.probabilities(), expected, atol=2e-4)


@given(st.floats(0.1, 0.8), st.floats(0, 50), st.integers(2, 6), st.floats(0, 4))
def test_probabilities_sum_to_one(height, angle, classes, alpha):
    frame = tables.plane(tables.camera(0, 0, height, angle, width=24, rows=18))
    running = SemanticFusion(alpha).begin(tables.LEVELS, classes)
    running.add(distributions(frame, classes), frame)
    found = running.probabilities()
    assert (found >= 0).all()
    np.testing.assert_allclose(found.sum(axis=0), 1, atol=1e-5)


def test_nothing_said_is_uniform():
    frame = tables.plane(tables.camera(0.02, 0.0, 0.06))
    running = SemanticFusion().begin(tables.LEVELS, 4)
    assert (running.probabilities() == 0.25).all()
    blind = tables.plane(tables.camera())
    blind.depth[:] = 0
    running.add(certain(blind, 1), blind)
    assert (running.probabilities() == 0.25).all()
    running.add(certain(frame, 1), frame)
    found = running.probabilities()
    assert (found[:, 0, :] == 0.25).all()
    assert found[1].max() > 0.9


@pytest.mark.parametrize("height", [0.2, 0.35, 0.6])  # levels 0, 1 and 2
def test_what_a_pixel_says_is_added_once(height):
    """Sums over all vertices equal those over the pixels, at whatever level they land."""
    frame = tables.plane(tables.camera(0, 0, height, width=20, rows=15))
    probabilities = distributions(frame, 3)
    running = SemanticFusion(alpha=0.0, floor=0.01).begin(tables.LEVELS, 3)
    running.add(probabilities, frame)
    inside = [tables.triangle(tables.LEVELS, p[:2]) is not None for p in tables.points(frame)]
    said = np.log(0.01 + 0.97 * probabilities.reshape(3, -1)[:, inside])
    state = running.state()["logits"].astype(np.float64)
    np.testing.assert_allclose(state.sum(axis=0), said.sum(axis=1), rtol=1e-5)
    logs = np.log(running.probabilities().astype(np.float64))  # merged, less a constant per vertex
    between = (logs[0] - logs[1]).sum(), (said[0] - said[1]).sum()
    edge = state[:, 0].nonzero()[0]
    assert edge.size > 0
    np.testing.assert_allclose(*between, atol=0.02 * np.abs(said[0] - said[1]).sum())


def test_later_evidence_recovers_from_a_wrong_frame():
    frame = tables.plane(tables.camera(0, 0, 0.2))
    running = SemanticFusion(alpha=0.0).begin(tables.SMALL, 4)
    running.add(certain(frame, 3), frame)
    assert running.probabilities()[3, 16, 16] > 0.99
    running.add(certain(frame, 1), frame)
    np.testing.assert_allclose(running.probabilities()[[1, 3], 16, 16], 0.5, atol=1e-3)
    running.add(certain(frame, 1), frame)
    assert running.probabilities()[1, 16, 16] > 0.99


def test_a_slanted_view_counts_less():
    straight, slanted = (
        tables.plane(tables.camera(x, 0, 0.2, angle)) for x, angle in ((0, 0), (-0.2, 45))
    )
    for power, wins in ((0.0, 1), (8.0, 2)):
        running = SemanticFusion(angle_power=power).begin(tables.SMALL, 4)
        for _ in range(8):
            running.add(certain(slanted, 1), slanted)
        running.add(certain(straight, 2), straight)
        assert running.probabilities()[:, 12:20, 12:20].mean(axis=(1, 2)).argmax() == wins


def test_a_state_goes_on_as_if_never_interrupted():
    frames = [tables.boxes(view) for view in tables.views(4)]
    labels = [distributions(frame, 3, seed) for seed, frame in enumerate(frames)]
    fusion = SemanticFusion()
    running = fusion.begin(tables.LEVELS, 3)
    for frame, probabilities in zip(frames[:2], labels[:2], strict=True):
        running.add(probabilities, frame)
    resumed = fusion.begin(tables.LEVELS, 3, state=running.state())
    from_map = fusion.begin(tables.LEVELS, 3, running.probabilities())
    np.testing.assert_allclose(from_map.probabilities(), running.probabilities(), atol=1e-5)
    for frame, probabilities in zip(frames[2:], labels[2:], strict=True):
        for each in (running, resumed, from_map):
            each.add(probabilities, frame)
    expected = running.probabilities()
    np.testing.assert_array_equal(resumed.probabilities(), expected)
    assert np.abs(from_map.probabilities() - expected).mean() < 1e-3


def test_mistakes_are_named():
    frame = tables.plane(tables.camera())
    running = SemanticFusion().begin(tables.SMALL, 3)
    with pytest.raises(InputError, match=r"shape \(4, 60, 80\), expected \(3, 60, 80\)"):
        running.add(certain(frame, 0), frame)
    with pytest.raises(InputError, match="finite"):
        running.add(np.full((3, 60, 80), np.nan), frame)
    for wrong in (
        100 * certain(frame, 0)[:3],
        np.full((3, 60, 80), 0.4),
        certain(frame, 0)[:3] - 1,
    ):
        with pytest.raises(InputError, match="softmax"):
            running.add(wrong, frame)
    with pytest.raises(InputError, match="earlier map"):
        SemanticFusion().begin(tables.SMALL, 3, np.zeros((2, 33, 33), np.float32))
    with pytest.raises(InputError, match="saved with"):
        SemanticFusion().begin(tables.LEVELS, 3, state=running.state())
    with pytest.raises(ConfigError, match=r"floor = 0\.3"):
        SemanticFusion(floor=0.3).begin(tables.SMALL, 4)
    with pytest.raises(ConfigError, match="floor = 0"):
        SemanticFusion(floor=0)
    with pytest.raises(ConfigError, match="alpha"):
        SemanticFusion(alpha=-1)
