"""Centre votes of one ball."""

import torch

from scenefw.core.batches import SceneParameters
from scenefw.core.types import GridSpec
from scenefw.representations.volumes import ExactScenes
from scenefw.representations.vote_field import VoteField


def test_votes_of_a_ball_meet_at_its_centre():
    grid = GridSpec(resolution=32)
    centre = torch.tensor([0.05, -0.1, 0.2])
    ball = SceneParameters(
        torch.full((1, 1, 3), 0.12),
        torch.full((1, 1, 3), 2.0),
        torch.eye(3)[None, None],
        centre[None, None],
        torch.ones(1, 1, dtype=torch.bool),
    )
    votes = VoteField().of_scenes(ExactScenes(ball, grid))[0]
    away = centre - torch.from_numpy(grid.centres()).float()
    distance = away.norm(dim=-1)
    inside = distance < 0.12 - 1e-4
    assert inside.sum() > 100
    hits = votes[:, inside].T * distance[inside][:, None]
    assert torch.allclose(hits, away[inside], atol=1e-5)
    assert not votes[:, distance > 0.12 + 1e-4].any()
