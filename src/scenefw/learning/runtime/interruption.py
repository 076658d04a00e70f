"""Ctrl-C and SIGTERM in a training: it ends after the step, with its state saved."""

import signal
import sys
import threading
from types import FrameType
from typing import Any, Self

import lightning

from scenefw.core.signals import stop_of
from scenefw.learning.module import TrainingModule

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption(lightning.Callback):
    """Stops a training of one process after the step in which a signal came; a second one at once.

    It is a context, which gives signals back to whom they belonged. In the midst of a step there is
    no state to save: some weights have made the step, and others have not.
    """

    def __init__(self) -> None:
        self.number: int | None = None
        """Of the signal that came."""

    def __enter__(self) -> Self:
        self._in_main = threading.current_thread() is threading.main_thread()
        self._before = {number: signal.getsignal(number) for number in _SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            if self._in_main:
                signal.signal(number, signal.SIG_DFL if handler is None else handler)

    def on_train_start(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Takes the signals; Lightning's own handlers, which drop the state, come before."""
        for number in _SIGNALS:
            if self._in_main and trainer.world_size == 1:
                signal.signal(number, self._note)

    def on_train_batch_end(
        self, trainer: lightning.Trainer, module: TrainingModule, *_: Any
    ) -> None:
        """Stops, without a last validation, which may take minutes."""
        if self.number is not None:
            trainer.limit_val_batches = 0
            trainer.should_stop = True

    def _note(self, number: int, _: FrameType | None) -> None:
        if self.number is not None:
            raise stop_of(number)
        self.number = number
        print("stopping after this step (Ctrl-C again: at once)", file=sys.stderr, flush=True)
