"""Flow matching on sets of superquadrics, given what a view shows of each, or nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

from scenefw.core.set_flows import SetFlowBatch, SetFlowPrediction
from scenefw.core.settings import COUNT, SHARE
from scenefw.matching.assignment import Assignment
from scenefw.models.set_attention import attention, time_waves
from scenefw.models.start_noise import start_noise
from scenefw_scene_prior.superquadric_tokens import SIZE, decode, described_in_all_ways, encode

if TYPE_CHECKING:
    from collections.abc import Sequence

_NEAR, _SCENE = 0.05, 0.2  # m: lengths of the order of one for parts and for scenes
_ANCHOR = (0.0, 0.0, 0.1)  # m, of objects of which nothing is seen
_POINT = 9
_DEFAULT_AXIS = 0.05  # m: half-axes of slots of which nothing is known


class SetFlow(nn.Module):
    """Draws sets of superquadrics: what is seen of objects decides how many slots belong to them.

    Each seen object gets a slot, and its points tell of it. The number of objects that aren't seen
    is drawn first, each of them gets a slot too, and then all are drawn together by conditional
    flow matching (Lipman et al. 2023). There is no order among slots. For some of the batch the
    view is left out, so the same network draws scenes without one (`share` of them).

    Args:
        slots: objects at most.
        width: channels of tokens.
        layers: of attention between objects while they are drawn.
        view_layers: of attention between parts of the view before.
        heads: of attention.
        share: of training views that are left out.
        repeats: noise and times for each training view, as a view costs more than they do.

    Raises:
        ConfigError: a number below one, or a share outside 0..1.
    """

    training_only: Sequence[str] = ()
    draws_hidden = True

    def __init__(
        self,
        slots: int = 8,
        width: int = 128,
        layers: int = 4,
        view_layers: int = 2,
        heads: int = 4,
        share: float = 0.12,
        repeats: int = 4,
    ) -> None:
        super().__init__()
        COUNT.require(slots=slots, width=width, layers=layers, heads=heads, repeats=repeats)
        COUNT.require(view_layers=view_layers)
        SHARE.require(share=share)
        self.recipe = {
            "_target_": f"{__name__}.SetFlow",
            "slots": slots,
            "width": width,
            "layers": layers,
            "view_layers": view_layers,
            "heads": heads,
            "share": share,
            "repeats": repeats,
        }
        self.slots, self.width, self.share, self.repeats = slots, width, share, repeats
        self.point = nn.Sequential(
            nn.Linear(_POINT, width // 2), nn.GELU(), nn.Linear(width // 2, width), nn.GELU(),
        )  # fmt: skip
        self.part = nn.Sequential(
            nn.Linear(2 * width + 7, width), nn.GELU(), nn.Linear(width, width)
        )
        self.whole = nn.Sequential(nn.Linear(5, width), nn.GELU(), nn.Linear(width, width))
        self.view = attention(width, view_layers, heads)
        self.counts = nn.Sequential(nn.Linear(width, width), nn.GELU(), nn.Linear(width, slots + 1))
        self.object = nn.Linear(SIZE, width)
        self.hidden = nn.Parameter(0.02 * torch.randn(width))
        self.time = nn.Sequential(nn.Linear(width, width), nn.GELU(), nn.Linear(width, width))
        self.flow = attention(width, layers, heads)
        self.velocity = nn.Sequential(nn.LayerNorm(width), nn.Linear(width, SIZE))

    def forward(
        self, batch: SetFlowBatch, generator: torch.Generator | None = None
    ) -> SetFlowPrediction:
        """Training pass: the velocity at a random time between noise and objects.

        Args:
            batch: views and objects.
            generator: of noise, times and views that are left out, on the CPU.
        """
        device = batch.points.device
        rows, slots = batch.present.shape
        has_view = (torch.rand(rows, generator=generator) >= self.share).to(device)
        time = torch.rand(rows * self.repeats, generator=generator).to(device)
        noise = torch.randn(rows * self.repeats, slots, SIZE, generator=generator).to(device)
        memory, counts = self.encode(batch, has_view)
        visible = batch.seen & has_view[:, None]
        objects = encode(
            batch.positions, batch.rotations, batch.half_axes, batch.exponents,
            anchors_of(batch, visible),
        )  # fmt: skip
        hidden = (batch.present & ~visible).sum(dim=1).clamp_max(self.slots)
        memory, objects, visible, present = (
            values.repeat_interleave(self.repeats, dim=0)
            for values in (memory, objects, visible, batch.present)
        )
        objects = coupled(objects, noise, present, visible)
        at = time[:, None, None]
        now = torch.where(present[..., None], (1 - at) * noise + at * objects, 0.0)
        velocity = self.velocity_of(now, time, memory, visible, present)
        return SetFlowPrediction(velocity, objects - noise, present, counts, hidden)

    def encode(self, batch: SetFlowBatch, has_view: Tensor) -> tuple[Tensor, Tensor]:
        """Tokens (B, 1 + N, width) of the view and its parts, and logits (B, slots + 1) of counts.

        Args:
            batch: views.
            has_view: (B,) bool; others are as if there were no view.
        """
        visible = batch.seen & has_view[:, None]
        points = batch.points
        middle = points.mean(dim=2)
        ray = nn.functional.normalize(middle - batch.camera[:, None], dim=-1)
        local = (points - middle[:, :, None]) / _NEAR
        features = torch.cat([local, points / _SCENE, ray[:, :, None].expand_as(local)], dim=-1)
        deep = self.point(features)
        pooled = torch.cat([deep.amax(dim=2), deep.mean(dim=2)], dim=-1)
        size = (batch.sizes.clamp_min(1e-5).log() + 4)[..., None]
        parts = self.part(torch.cat([pooled, middle / _SCENE, ray, size], dim=-1))
        number = visible.sum(dim=1, keepdim=True) / 4
        view_flag = has_view[:, None].float()
        view_token = self.whole(torch.cat([batch.camera * view_flag, view_flag, number], dim=-1))
        tokens = torch.cat(
            [view_token[:, None], torch.where(visible[..., None], parts, 0.0)], dim=1
        )
        mask = torch.cat([visible.new_ones(len(visible), 1), visible], dim=1)
        memory = self.view(tokens, src_key_padding_mask=~mask)
        return memory, self.counts(memory[:, 0])

    def velocity_of(
        self, now: Tensor, time: Tensor, memory: Tensor, visible: Tensor, present: Tensor
    ) -> Tensor:
        """Velocity (B, N, 15) of objects at times (B,).

        Args:
            now: (B, N, 15), between noise and objects.
            time: (B,) from 0, noise, to 1.
            memory: of `encode`.
            visible: (B, N) bool: slots of parts of the view.
            present: (B, N) bool: slots that count.
        """
        clock = self.time(time_waves(time, self.width))[:, None]
        about = torch.where(visible[..., None], memory[:, 1:], self.hidden)
        tokens = torch.cat([memory[:, :1], self.object(now) + about], dim=1) + clock
        mask = torch.cat([present.new_ones(len(present), 1), present], dim=1)
        return self.velocity(self.flow(tokens, src_key_padding_mask=~mask)[:, 1:])

    @torch.no_grad()
    def sample(
        self,
        batch: SetFlowBatch,
        count: int,
        generator: torch.Generator,
        steps: int = 20,
        spread: Sequence[float] | None = None,
    ) -> SetFlowBatch:
        """Draws sets for one view, whose objects are those that are seen, as `SetFlowModel` says.

        Returns:
            The rows that draws saw, in slots those that are seen and then those that aren't.
        """
        view = _seen_alone(batch)
        memory, hidden = self._hidden(view, count, generator, has_view=True)
        return self._draw(view, memory, hidden, generator, steps, spread=spread)

    @torch.no_grad()
    def hidden_number(self, batch: SetFlowBatch, generator: torch.Generator) -> int:
        """Draws how many objects a view hides whose seen objects are known.

        Args:
            batch: as for `complete`.
            generator: of the draw, on the CPU.
        """
        return int(self._hidden(_seen_alone(batch), 1, generator, has_view=True)[1])

    @torch.no_grad()
    def complete(
        self,
        batch: SetFlowBatch,
        count: int,
        objects: int,
        generator: torch.Generator,
        steps: int = 20,
    ) -> SetFlowBatch:
        """Draws objects of which nothing is seen, for one view whose seen objects are known.

        Known objects are led from noise to where they are, and the others are drawn beside them.

        Args:
            batch: one view, in rows as for `sample`, and what its seen objects are.
            count: of draws, S.
            objects: how many are hidden in each draw (`hidden_number`).
            generator: of noise, on the CPU.
            steps: of Euler's method.

        Returns:
            The rows that draws saw, in slots those that are seen, as they are, and then those that
            aren't.
        """
        view = _seen_alone(batch)
        memory, _ = self._hidden(view, count, generator, has_view=True)
        hidden = torch.full((count,), objects)
        return self._draw(view, memory, hidden, generator, steps, fix_visible=True)

    @torch.no_grad()
    def scenes(
        self,
        count: int,
        generator: torch.Generator,
        steps: int = 20,
        objects: int | None = None,
    ) -> SetFlowBatch:
        """Draws scenes without a view.

        Args:
            count: of draws, S.
            generator: of noise, on the CPU.
            steps: of Euler's method.
            objects: how many each scene has; None: drawn too.

        Returns:
            S views of which nothing is seen, with their objects.
        """
        view = _empty_view(self.hidden.device)
        memory, hidden = self._hidden(view, count, generator, has_view=False)
        hidden = hidden.clamp_min(1) if objects is None else torch.full((count,), objects)
        return self._draw(view, memory, hidden, generator, steps)

    def _hidden(
        self, view: SetFlowBatch, count: int, generator: torch.Generator, *, has_view: bool
    ) -> tuple[Tensor, Tensor]:
        """Tokens of each draw of one view, and how many hidden objects (S,) there are in it."""
        device, views = view.points.device, len(view.points)
        memory, logits = self.encode(view, torch.full((views,), has_view, device=device))
        rows = torch.arange(count, device=device) % views
        chances = logits[rows].softmax(dim=-1).cpu()
        return memory[rows], torch.multinomial(chances, 1, generator=generator)[:, 0]

    def _draw(
        self,
        view: SetFlowBatch,
        memory: Tensor,
        hidden: Tensor,
        generator: torch.Generator,
        steps: int,
        *,
        fix_visible: bool = False,
        spread: Sequence[float] | None = None,
    ) -> SetFlowBatch:
        device = view.points.device
        count, parts = len(hidden), view.seen.shape[1]
        extra = max(int(hidden.max()), 1)
        noise = start_noise((count, parts + extra, SIZE), generator, spread).to(device)
        hidden_mask = torch.arange(extra)[None] < hidden[:, None]
        views = _with_hidden(view, hidden_mask.to(device))
        visible, present, points = views.seen, views.present, views.points
        empty = memory.new_zeros(count, extra, memory.shape[-1])
        memory = torch.cat([memory, empty], dim=1)
        anchors = _anchors(points, visible)
        objects = encode(
            views.positions, views.rotations, views.half_axes, views.exponents, anchors
        )
        objects = coupled(objects, noise, visible, visible)
        fixed_mask = visible[..., None] & torch.full((1,), fix_visible, device=device)
        now = noise
        for step in range(steps):
            time = torch.full((count,), step / steps, device=device)
            next_state = now + self.velocity_of(now, time, memory, visible, present) / steps
            at = (step + 1) / steps
            now = torch.where(fixed_mask, (1 - at) * noise + at * objects, next_state)
        centres, rotations, half_axes, exponents = decode(now, anchors)
        return replace(
            views,
            half_axes=half_axes,
            exponents=exponents,
            rotations=rotations,
            positions=centres,
        )


def _with_hidden(view: SetFlowBatch, hidden_mask: Tensor) -> SetFlowBatch:
    """A view with slots for hidden objects.

    Args:
        view: one, of N objects, in one or more rows.
        hidden_mask: (S, H) which hidden objects there are in S draws.

    Returns:
        The rows that draws see, with N + H slots.
    """
    count, extra = hidden_mask.shape
    rows = torch.arange(count, device=hidden_mask.device) % len(view.points)

    def longer(values: Tensor) -> Tensor:
        shape = count, extra, *values.shape[2:]
        return torch.cat([values[rows], values.new_zeros(shape)], dim=1)

    fields: dict[str, Tensor] = vars(view)
    slots = {name: longer(value) for name, value in fields.items() if name != "camera"}
    views = SetFlowBatch(camera=view.camera[rows], **slots)
    default_axes = torch.full_like(views.half_axes, _DEFAULT_AXIS)
    empty = ~views.seen[..., None]
    return replace(
        views,
        present=torch.cat([views.seen[:, : view.seen.shape[1]], hidden_mask], dim=1),
        half_axes=torch.where(empty, default_axes, views.half_axes),
        exponents=torch.where(empty, 2.0, views.exponents),
        rotations=torch.where(empty[..., None], torch.eye(3).to(default_axes), views.rotations),
    )


def anchors_of(batch: SetFlowBatch, visible: Tensor) -> Tensor:
    """What centres (B, N, 3) are told from: the middle of seen points, or a place of the scene."""
    return _anchors(batch.points, visible)


def _anchors(points: Tensor, visible: Tensor) -> Tensor:
    return torch.where(visible[..., None], points.mean(dim=2), points.new_tensor(_ANCHOR))


@torch.no_grad()
def coupled(objects: Tensor, noise: Tensor, present: Tensor, visible: Tensor) -> Tensor:
    """Objects (B, N, 15), each described in the way that is nearest to its noise.

    Slots of objects that aren't seen may hold any of them: the noise takes those for which the sum
    of squared distances is least. Paths then cross less.

    Args:
        objects: (B, N, 15).
        noise: (B, N, 15).
        present: (B, N) bool.
        visible: (B, N) bool: objects whose slot is decided.
    """
    ways = described_in_all_ways(objects)
    free = present & ~visible
    slots = torch.arange(objects.shape[1], device=objects.device).expand(len(objects), -1).clone()
    several = (free.sum(dim=1) > 1).nonzero()[:, 0].tolist()
    for row in several:
        indices = free[row].nonzero()[:, 0]
        gaps = (noise[row, indices][:, None, None] - ways[row, indices][None]).square().sum(-1)
        pairs = torch.from_numpy(Assignment().assign(gaps.amin(dim=-1).cpu().numpy())).to(indices)
        slots[row, indices[pairs[:, 0]]] = indices[pairs[:, 1]]
    ways = ways.gather(1, slots[..., None, None].expand_as(ways))
    best = (noise[:, :, None] - ways).square().sum(dim=-1).argmin(dim=-1)
    return ways.gather(2, best[..., None, None].expand(-1, -1, 1, SIZE))[:, :, 0]


def _seen_alone(batch: SetFlowBatch) -> SetFlowBatch:
    """One view, in one or more rows, with its seen objects alone."""
    visible = batch.seen[0]
    fields: dict[str, Tensor] = vars(batch)
    of_objects = {name: value[:, visible] for name, value in fields.items() if name != "camera"}
    return SetFlowBatch(camera=batch.camera, **of_objects)


def _empty_view(device: torch.device) -> SetFlowBatch:
    """A view without any object."""

    def empty(*shape: int) -> Tensor:
        return torch.zeros(1, 0, *shape, device=device)

    none = torch.zeros(1, 0, dtype=torch.bool, device=device)
    return SetFlowBatch(
        points=empty(1, 3), seen=none, sizes=empty(), ends=empty(1, 7),
        camera=torch.zeros(1, 3, device=device), half_axes=empty(3), exponents=empty(3),
        rotations=empty(3, 3), positions=empty(3), present=none,
    )  # fmt: skip
