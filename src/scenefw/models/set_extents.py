"""Flow matching on how far objects go on where nothing is seen, along axes that are known."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

from scenefw.core.set_flows import SetFlowBatch, SetFlowPrediction
from scenefw.core.settings import COUNT, NOT_NEGATIVE
from scenefw.kernels.precision import full_precision
from scenefw.models.recipes import recipe_of
from scenefw.models.set_attention import attention, time_waves
from scenefw.models.start_noise import start_noise

if TYPE_CHECKING:
    from collections.abc import Sequence

SIZE = 9
"""Numbers of an object: beyond what is seen away from the camera 3, towards it 3; exponents 3."""
_NEAR, _SCENE = 0.05, 0.2  # m: lengths of the order of one for objects and for scenes
_STEP = 0.005  # m: logarithmic above, linear below
_AWAY, _TOWARDS = (1.6, 1.5), (0.5, 0.8)  # mean and deviation of these
_EXPONENT = (2.7, 1.1)
_RANGE = 1.1, 100.0
_MIN_HALF_AXIS = 0.004  # m, of half-axes
_POINT, _SCALAR, _END = 6, 28, 10


class SetExtents(nn.Module):
    """Draws how far each seen object goes on, given its points and the directions of its axes.

    A fit finds the directions of an object's axes from what is seen, and where its seen faces are.
    What the view leaves open is where the hidden faces lie. So each object is told in its own axes:
    those that point most towards the camera first, and each with the sign that points to it. The
    network sees its points, where its image ends, and points of other objects, all in that frame.
    It draws, for all objects together, how far each goes beyond its points on either side of each
    axis. There is no order among objects. Objects of which nothing is seen are not drawn
    (`set_flow` has them).

    In training, axes are those of the true objects, turned a little.

    Args:
        slots: objects at most.
        width: channels of tokens.
        layers: of attention between objects.
        heads: of attention.
        repeats: noise and times for each training view, as a view costs more than they do.
        turn: by how much axes are turned in training (degrees, standard deviation about each).
        others: points of each other object that an object sees.
        ends: it sees where images of objects end, and whether what follows is behind or before.

    Raises:
        ConfigError: a number below one, or a negative angle.
    """

    training_only: Sequence[str] = ()
    draws_hidden = False

    def __init__(
        self,
        slots: int = 8,
        width: int = 128,
        layers: int = 3,
        heads: int = 4,
        repeats: int = 4,
        turn: float = 2.0,
        others: int = 12,
        *,
        ends: bool,
    ) -> None:
        super().__init__()
        COUNT.require(
            slots=slots, width=width, layers=layers, heads=heads, repeats=repeats, others=others
        )
        NOT_NEGATIVE.require(turn=turn)
        self.recipe = recipe_of(self, locals())
        self.slots, self.width, self.repeats = slots, width, repeats
        self.turn, self.others = math.radians(turn), others
        half = width // 2
        self.point = _mlp(_POINT, half, half)
        self.other = _mlp(_POINT, half, half)
        self.scalars = _mlp(_SCALAR, width, width)
        self.part = nn.Sequential(nn.Linear(3 * half + width, width), nn.GELU(), _linear(width))
        self.ends = nn.ModuleList([_mlp(_END, half, half), _started(2 * half, width)] * ends)
        self.view = attention(width, layers, heads)
        self.object = nn.Linear(SIZE, width)
        self.time = nn.Sequential(_linear(width), nn.GELU(), _linear(width))
        self.flow = attention(width, layers, heads)
        self.velocity = nn.Sequential(nn.LayerNorm(width), nn.Linear(width, SIZE))

    def forward(
        self, batch: SetFlowBatch, generator: torch.Generator | None = None
    ) -> SetFlowPrediction:
        """Training pass: the velocity at a random time between noise and extents.

        Args:
            batch: views and objects.
            generator: of noise, times and turns of axes, on the CPU.
        """
        device = batch.points.device
        rows, slots = batch.present.shape
        angles = self.turn * torch.randn(rows, slots, 3, generator=generator)
        time = torch.rand(rows * self.repeats, generator=generator).to(device)
        noise = torch.randn(rows * self.repeats, slots, SIZE, generator=generator).to(device)
        turned = _product("bnij,bnjk->bnik", batch.rotations, _turns(angles).to(device))
        axes, low, high, order = seen_in_axes(batch, turned)
        extents = _encoded(batch, axes, low, high, order)
        memory = self.encode(batch, axes, low, high)
        memory, extents, visible = (
            values.repeat_interleave(self.repeats, dim=0)
            for values in (memory, extents, batch.seen)
        )
        at = time[:, None, None]
        now = (1 - at) * noise + at * extents
        velocity = self.velocity_of(now, time, memory, visible)
        return SetFlowPrediction(velocity, extents - noise, visible, None, None)

    def encode(self, batch: SetFlowBatch, axes: Tensor, low: Tensor, high: Tensor) -> Tensor:
        """Tokens (B, N, width) of seen objects.

        Args:
            batch: views.
            axes: (B, N, 3, 3), rows, of `seen_in_axes`.
            low: (B, N, 3) where what is seen of them begins along these.
            high: (B, N, 3) where it ends, nearest to the camera.
        """
        count = batch.points.shape[1]
        visible = batch.seen
        corner = _product("bnki,bnk->bni", axes, high)
        local = _along(axes, batch.points) - high[:, :, None]
        points = self.point(torch.cat([local / _NEAR, _close(local)], dim=-1))
        neighbour_points = batch.points[:, :, : self.others].flatten(1, 2)
        far = _product("bnki,bpi->bnpk", axes, neighbour_points) - high[:, :, None]
        neighbour_features = self.other(torch.cat([far / _NEAR, _close(far)], dim=-1))
        of = torch.arange(count, device=visible.device).repeat_interleave(
            min(self.others, batch.points.shape[2])
        )
        alien = visible[:, None, of] & (of != torch.arange(count, device=of.device)[:, None])
        neighbour_features = neighbour_features.masked_fill(~alien[..., None], -1.0).amax(dim=2)
        size = high - low
        eye = _product("bnki,bni->bnk", axes, batch.camera[:, None] - corner)
        down = axes[..., 2]  # how steeply it goes down away from the camera
        floor = ((corner[..., 2:] - size * axes[..., 2]) / down.clamp_min(0.05)).clamp(-1.0, 1.0)
        scalars = torch.cat(
            [
                _close(size),
                (size.clamp_min(1e-3).log() + 3),
                axes.flatten(-2),
                corner / _SCENE,
                eye,
                _close(torch.where(down > 0.05, floor, 1.0)),
                (batch.sizes.clamp_min(1e-5).log() + 4)[..., None],
                torch.where(down > 0.05, 1.0, 0.0),
            ],
            dim=-1,
        )
        pooled = torch.cat([points.amax(dim=2), points.mean(dim=2), neighbour_features], dim=-1)
        tokens = self.part(torch.cat([pooled, self.scalars(scalars)], dim=-1))
        if len(self.ends):
            tokens = tokens + self._where_it_ends(batch.ends, axes, corner)
        return self.view(_masked_tokens(tokens, visible), src_key_padding_mask=_absent(visible))

    def _where_it_ends(self, ends: Tensor, axes: Tensor, corner: Tensor) -> Tensor:
        """What is added to tokens (B, N, width) for the ends (B, N, E, 7) of objects' images."""
        place, outward, depth_step = ends.split([3, 3, 1], dim=-1)
        local = _along(axes, place - corner[:, :, None])
        features = torch.cat(
            [local / _NEAR, _close(local), _along(axes, outward), _close(depth_step)], dim=-1
        )
        of_each, together = self.ends
        end_features = of_each(features) * outward.any(dim=-1, keepdim=True)
        added: Tensor = together(
            torch.cat([end_features.amax(dim=2), end_features.mean(dim=2)], dim=-1)
        )
        return added

    def velocity_of(self, now: Tensor, time: Tensor, memory: Tensor, visible: Tensor) -> Tensor:
        """Velocity (B, N, 9) of extents at times (B,).

        Args:
            now: (B, N, 9), between noise and extents.
            time: (B,) from 0, noise, to 1.
            memory: of `encode`.
            visible: (B, N) bool.
        """
        clock = self.time(time_waves(time, self.width))[:, None]
        tokens = _masked_tokens(self.object(now) + memory + clock, visible)
        return self.velocity(self.flow(tokens, src_key_padding_mask=_absent(visible)))

    @torch.no_grad()
    def sample(
        self,
        batch: SetFlowBatch,
        count: int,
        generator: torch.Generator,
        steps: int = 20,
        spread: Sequence[float] | None = None,
    ) -> SetFlowBatch:
        """Draws sets for one view, with the axes that its objects have.

        Args:
            batch: one view, in rows that show other points of it; draw k sees row k, and those
                after the last begin with the first again. Of its objects the rotations are taken,
                nothing else.
            count: of draws, S.
            generator: of noise, on the CPU.
            steps: of Euler's method.
            spread: standard deviation of the noise of each draw; None: 1, as in training.

        Returns:
            The rows that draws saw, S of them.
        """
        device = batch.points.device
        rows = torch.arange(count, device=device) % len(batch.points)
        axes, low, high, order = seen_in_axes(batch, batch.rotations)
        memory = self.encode(batch, axes, low, high)[rows]
        axes, low, high, order = axes[rows], low[rows], high[rows], order[rows]
        fields: dict[str, Tensor] = vars(batch)
        views = SetFlowBatch(**{name: value[rows] for name, value in fields.items()})
        visible = views.seen
        now = start_noise((count, visible.shape[1], SIZE), generator, spread).to(device)
        for step in range(steps):
            time = torch.full((count,), step / steps, device=device)
            now = now + self.velocity_of(now, time, memory, visible) / steps
        far_extent = _length(now[..., :3], _AWAY)
        near_extent = _length(now[..., 3:6], _TOWARDS)
        first, last = low - far_extent, high + near_extent
        half_axes = ((last - first) / 2).clamp_min(_MIN_HALF_AXIS)
        centres = _product("bnki,bnk->bni", axes, (first + last) / 2)
        exponents = (now[..., 6:] * _EXPONENT[1] + _EXPONENT[0]).exp().clamp(*_RANGE)
        inverse_order = order.argsort(dim=-1)
        return replace(
            views,
            half_axes=half_axes.gather(-1, inverse_order),
            exponents=exponents.gather(-1, inverse_order),
            positions=centres,
            present=visible,
        )


def seen_in_axes(batch: SetFlowBatch, rotations: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Axes that point to the camera, and what is seen along them.

    Args:
        batch: views.
        rotations: (B, N, 3, 3), columns are the axes.

    Returns:
        Axes (B, N, 3, 3) in rows, the one nearest to the direction of the camera first; where the
        seen points begin and end along each (B, N, 3) m; which column each was (B, N, 3).
    """
    ahead = batch.camera[:, None] - batch.points.mean(dim=2)
    along = _product("bnik,bni->bnk", rotations, ahead)
    order = along.abs().argsort(dim=-1, descending=True)
    signs = torch.where(along < 0, -1.0, 1.0).gather(-1, order)
    rows = rotations.transpose(-1, -2).gather(-2, order[..., None].expand(-1, -1, -1, 3))
    axes = rows * signs[..., None]
    places = _along(axes, batch.points)
    return axes, places.amin(dim=2), places.amax(dim=2), order


def _encoded(batch: SetFlowBatch, axes: Tensor, low: Tensor, high: Tensor, order: Tensor) -> Tensor:
    """True extents and exponents (B, N, 9) of seen objects, about zero."""
    middle = _product("bnki,bni->bnk", axes, batch.positions)
    half = batch.half_axes.gather(-1, order)
    far_extent = _number(low - (middle - half), _AWAY)
    near_extent = _number(middle + half - high, _TOWARDS)
    exponents = (batch.exponents.gather(-1, order).log() - _EXPONENT[0]) / _EXPONENT[1]
    numbers = torch.cat([far_extent, near_extent, exponents], dim=-1)
    return torch.where(batch.seen[..., None], numbers, 0.0)


def _number(length: Tensor, about: tuple[float, float]) -> Tensor:
    return (torch.asinh(length / _STEP) - about[0]) / about[1]


def _length(number: Tensor, about: tuple[float, float]) -> Tensor:
    return _STEP * torch.sinh((number * about[1] + about[0]).clamp(-3.0, 5.0))


def _close(length: Tensor) -> Tensor:
    """Lengths on a scale that tells millimetres apart near zero."""
    return torch.asinh(length / _STEP) / 3


def _along(axes: Tensor, points: Tensor) -> Tensor:
    """Coordinates (B, N, P, 3) of points along axes."""
    return _product("bnki,bnpi->bnpk", axes, points)


@full_precision()
def _product(equation: str, first: Tensor, second: Tensor) -> Tensor:
    product: Tensor = torch.einsum(equation, first, second)
    return product


@full_precision()
def _turns(angles: Tensor) -> Tensor:
    """Rotations (..., 3, 3) by the lengths of vectors, about them (Rodrigues)."""
    x, y, z = angles.unbind(dim=-1)
    zero = torch.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    cross = torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)
    return torch.linalg.matrix_exp(cross)


def _masked_tokens(tokens: Tensor, visible: Tensor) -> Tensor:
    return torch.where(visible[..., None], tokens, 0.0)


def _absent(visible: Tensor) -> Tensor:
    """Slots that attention leaves out; in rows without any object it keeps the first."""
    absent = ~visible
    absent[:, 0] &= visible.any(dim=1)
    return absent


def _linear(width: int) -> nn.Linear:
    return nn.Linear(width, width)


def _started(inputs: int, outputs: int) -> nn.Linear:
    """A layer that gives 0 until it is trained.

    Its output is added to what other layers give, so a network that gets it later on starts as the
    network that it was.
    """
    layer = nn.Linear(inputs, outputs)
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer


def _mlp(inputs: int, width: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, width), nn.GELU(), nn.Linear(width, outputs), nn.GELU())
