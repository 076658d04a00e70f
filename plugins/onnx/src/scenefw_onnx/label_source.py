"""Labels of views by an exported network, run by onnxruntime."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import CheckpointError, ConfigError, InputError, MissingDependencyError
from scenefw.core.types import Frame
from scenefw.labelling.network_inputs import DEPTH, distance_image

_PREFIX = "scenefw."


class OnnxLabels:
    """Labels views with a network that `run=export_onnx` wrote.

    On a CPU it may be quicker than torch, and the file also runs where scenefw doesn't.

    Args:
        path: the `.onnx` file of a network for views.
        classes: names by class id to expect; None takes those of the file.
        threads: of onnxruntime; None = one for each core.

    Raises:
        ConfigError: there is no path, or no thread.
        CheckpointError: the file is missing, damaged, of no network for views, or has other
            classes.
        MissingDependencyError: onnxruntime is not installed.
    """

    def __init__(
        self,
        path: str | Path | None,
        classes: Sequence[str] | None = None,
        threads: int | None = None,
    ) -> None:
        if path is None:
            raise ConfigError(
                "label_source=onnx needs label_source.path=FILE.onnx, as "
                "run=export_onnx checkpoint=label_views writes it"
            )
        if threads is not None and threads < 1:
            raise ConfigError(f"label_source.threads is {threads}; expected at least 1, or null")
        self.session = _session(Path(path), threads)
        facts = _facts(self.session)
        if facts.get("input", "views") != "views" or "classes" not in facts:
            raise CheckpointError(
                f"{path} holds no network that labels views; export one by run=export_onnx "
                "checkpoint=label_views"
            )
        self.classes = tuple(facts["classes"])
        if classes is not None and tuple(classes) != self.classes:
            raise CheckpointError(
                f"{path} has the classes {', '.join(self.classes)}, expected {', '.join(classes)}"
            )
        self.geometry = str(facts.get("geometry", DEPTH))

    def label(self, frame: Frame) -> NDArray[np.float32]:
        """Probabilities (C, H, W) of the classes.

        Raises:
            InputError: the frame has no colour.
        """
        if frame.colour is None:
            raise InputError(f"frame {frame.name} has no colour image, which the network needs")
        colour = np.moveaxis(frame.colour, -1, 0).astype(np.float32) / np.float32(255)
        distance = np.asarray(distance_image(frame, self.geometry), np.float32)
        feeds = {"colour": colour[None], "distance": distance[None, None]}
        scores = np.asarray(self.session.run(["scores"], feeds)[0][0], np.float32)
        exponentials = np.exp(scores - scores.max(axis=0))
        return np.asarray(exponentials / exponentials.sum(axis=0), np.float32)


def _session(path: Path, threads: int | None) -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise MissingDependencyError(
            "label_source=onnx needs onnxruntime: pip install 'scenefw[onnx]'"
        ) from error
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads or 0
    options.inter_op_num_threads = 1
    options.log_severity_level = 3  # errors become ours
    try:
        content = path.read_bytes()  # as bytes it can't point to other files
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except OSError as error:
        raise CheckpointError(f"cannot read {path}: {error.strerror}") from error
    except Exception as error:  # onnxruntime has a class for each of its failures
        reason = str(error).splitlines()[0]
        raise CheckpointError(f"{path} is no ONNX file: {reason}") from error


def _facts(session: Any) -> dict[str, Any]:
    metadata = session.get_modelmeta().custom_metadata_map
    try:
        return {
            key.removeprefix(_PREFIX): json.loads(value)
            for key, value in metadata.items()
            if key.startswith(_PREFIX)
        }
    except ValueError:
        return {}
