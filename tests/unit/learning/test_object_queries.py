"""The training of decoders of sets."""

import lightning
import pytest
import torch
from tests.unit.data.batches.test_image_queries import viewpoints
from tests.unit.data.stacks_file import write_stacks
from tests.unit.learning.tiny import views
from tests.unit.models.queries import RESOLUTION, image_queries, queries

from scenefw.core.errors import ConfigError
from scenefw.core.queried_sets import ObjectQueryPrediction
from scenefw.core.types import GridSpec
from scenefw.data.batches.image_queries import ImageQueryViews
from scenefw.data.batches.object_queries import ObjectQueryViews
from scenefw.learning.checkpoint import OBJECT_QUERIES, load_checkpoint
from scenefw.learning.object_queries import ObjectQueryLearning, figures, matched
from scenefw.learning.runtime.trainer import TrainerSettings
from scenefw.learning.schedules import CosineDecay
from scenefw.losses.query_distance import QueryDistance
from scenefw.losses.query_existence import QueryExistence
from scenefw.losses.query_parameters import QueryParameters
from scenefw.losses.tsdf import TsdfLoss
from scenefw.tasks.train import Train

STEPS = 160
ONE_BATCH = {"limit": 2, "batch_size": 2, "distinct_batches": 1}
LOSSES = {
    "query_existence": QueryExistence(),
    "query_distance": QueryDistance(),
    "query_parameters": QueryParameters(),
}


@pytest.fixture
def stacks(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return str(tmp_path / "stacks.npz")


def images(stacks):
    return ImageQueryViews(viewpoints(), GridSpec(RESOLUTION), stacks, limit=4, validation_limit=2,
                      batch_size=2, width=64, places=64)  # fmt: skip


def data(stacks, resolution=RESOLUTION, **options):
    sizes = {"limit": 4, "validation_limit": 2, "batch_size": 4, "points": 128, "places": 128}
    return ObjectQueryViews(views(resolution), stacks, **{**sizes, **options})


def test_it_learns_one_batch_by_heart(stacks):
    """Objects that at first are balls at seen points overlap with the true ones in the end."""
    made = data(stacks, **ONE_BATCH)
    module = ObjectQueryLearning(
        queries(tokens=32), LOSSES, learning_rate=4e-3, average=0.0, early=0.5,
        schedule=CosineDecay(steps=STEPS, warmup=5),
    )  # fmt: skip
    module.check(made)
    trainer = lightning.Trainer(
        accelerator="cpu", max_steps=STEPS, logger=False, enable_checkpointing=False,
        enable_progress_bar=False, enable_model_summary=False, limit_val_batches=0,
    )  # fmt: skip
    batch = made.training_batch(made.train_dataloader().batch(0), torch.device("cpu"))

    def scores():
        with torch.no_grad():
            found = matched(module.model(batch), batch)
            return figures(found.layers[-1], batch), LOSSES["query_distance"](found, batch)

    before, at_first = scores()
    trainer.fit(module, made)
    after, at_last = scores()
    assert at_last < 0.25 * at_first
    assert before["val/overlap"] < 0.2
    assert after["val/overlap"] > 0.6
    assert after["val/count_error"] == 0
    assert after["val/centre_error"] < 0.02


def test_denoised_queries_of_images_learn_to_find_their_objects(stacks):
    """Near queries come nearer and far ones learn to be nothing, each by its own loss."""
    made = ImageQueryViews(viewpoints(), GridSpec(32), stacks, limit=2, validation_limit=2,
                      batch_size=2, distinct_batches=1, width=64, places=64)  # fmt: skip
    module = ObjectQueryLearning(
        image_queries(tokens=32, denoised=2), LOSSES, learning_rate=8e-3, average=0.0,
        schedule=CosineDecay(steps=100, warmup=5),
    )  # fmt: skip
    module.check(made)
    batch = made.training_batch(made.train_dataloader().batch(0), torch.device("cpu"))

    def scores():
        """Loss of distances of denoised queries alone, and how sure near and far ones are."""
        with torch.no_grad():
            found = module.model(batch, torch.Generator().manual_seed(3))
            last = found.denoised[-1]
            alone = ObjectQueryPrediction([last])
            sure = last.existence.sigmoid()
            near = sure[last.matched >= 0].mean()
            far = sure[(last.matched < 0) & last.active].mean()
            return LOSSES["query_distance"](alone, batch), near - far

    before, apart_before = scores()
    trainer = lightning.Trainer(
        accelerator="cpu", max_steps=100, logger=False, enable_checkpointing=False,
        enable_progress_bar=False, enable_model_summary=False, limit_val_batches=0,
    )  # fmt: skip
    trainer.fit(module, made)
    after, apart = scores()
    assert after < 0.85 * before  # sizes have a noise of 40 %
    assert abs(apart_before) < 0.2
    assert apart > 0.3


def test_the_noise_of_a_step_follows_from_seed_and_step(stacks):
    made = data(stacks)
    batch = made.training_batch(made.train_dataloader().batch(0), torch.device("cpu"))
    starts = []
    for seed, step in ((0, 0), (0, 0), (0, 1), (1, 0)):
        module = ObjectQueryLearning(queries(denoised=1), LOSSES, seed=seed)
        module.batches_seen = step
        starts.append(module.predict_batch(batch).denoised[0].starts)
    assert torch.equal(starts[0], starts[1])
    assert not torch.allclose(starts[0], starts[2])
    assert not torch.allclose(starts[0], starts[3])


def test_early_losses_stop_after_their_share_of_the_budget():
    module = ObjectQueryLearning(queries(), LOSSES, early=0.3)
    module.budget_done = 0.29
    assert set(module.losses_now()) == set(LOSSES)
    module.budget_done = 0.3
    assert set(module.losses_now()) == {"query_existence", "query_distance"}


def test_a_training_exports_what_predicts_the_same(stacks, tmp_path):
    model = queries()
    learning = ObjectQueryLearning(model, LOSSES, schedule=CosineDecay(steps=2, warmup=1))
    made = data(stacks)
    settings = TrainerSettings("cpu", max_steps=2, max_epochs=-1, validate_every=1)
    Train(learning, made, settings, tmp_path / "out", tmp_path / "state", name="sets", half=False,
          log_every=1).run()  # fmt: skip
    text = (tmp_path / "out" / "losses.csv").read_text()
    for name in ("train/query_distance", "val/overlap", "val/count_error"):
        assert name in text
    loaded = load_checkpoint(tmp_path / "out" / "sets.safetensors", task=OBJECT_QUERIES)
    assert loaded.grid == loaded.model.grid == made.grid
    batch = made.validation_batch(made.val_dataloader().batch(0), torch.device("cpu"))
    given = (batch.condition, batch.points, batch.seen)
    with learning.averaged(), torch.no_grad():
        wanted = model.eval().predict(*given).positions
    assert torch.allclose(loaded.model.predict(*given).positions, wanted, atol=1e-5)


def test_what_does_not_go_together_is_refused_in_one_line(stacks):
    made = data(stacks)
    cases = (
        (queries(), LOSSES, data(stacks, resolution=8), "grid.resolution=16"),
        (queries(seeded=1, free=1), LOSSES, made, "has 2 queries"),
        (queries(), LOSSES, images(stacks), "sees views as volumes, the data are images"),
        (image_queries(), LOSSES, made, "sees views as images, the data are volumes"),
        (queries(), {"tsdf": TsdfLoss()}, made, "loss tsdf is for trainings"),
    )
    for model, losses, given, words in cases:
        with pytest.raises(ConfigError, match=words) as caught:
            ObjectQueryLearning(model, losses).check(given)
        assert "\n" not in str(caught.value)
    with pytest.raises(ConfigError, match=r"learning\.early is 2"):
        ObjectQueryLearning(queries(), LOSSES, early=2.0)
