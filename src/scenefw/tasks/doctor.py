"""Checks depth images as a prediction would, and says what to mend."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import require_writable
from scenefw.data.arrays import read_mask
from scenefw.data.readers import find_images, read_frame
from scenefw.perception.doctor import ODD, UNUSABLE, unusable
from scenefw.perception.examination import Examination
from scenefw.report.pictures import save_picture
from scenefw.report.seen import draw_examination

if TYPE_CHECKING:
    from scenefw.perception.examination import Examiner


class Examine:
    """Prints a verdict per check of each image, with the mend, and draws what is seen of it.

    The pictures are `NAME.png` in the output folder.

    Args:
        input: a depth image or a folder of them.
        examiner: makes the checks.
        output: where the pictures go.
        intrinsics: file with the intrinsics of .png and .npy images; None looks beside them.
        depth_scale: metres per unit of integer depth; None = that of the format, else millimetres.
        masks: as of `run=predict`.

    Raises:
        ConfigError: no input is given, or the depth scale is not positive.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        examiner: Examiner,
        output: str | Path = "outputs",
        intrinsics: str | Path | None = None,
        depth_scale: float | None = None,
        masks: str | Path | None = None,
    ) -> None:
        if input is None:
            raise ConfigError("run=doctor needs input=PATH of a depth image or a folder of them")
        if depth_scale is not None and not depth_scale > 0:
            raise ConfigError(f"run.depth_scale = {depth_scale}: expected metres per unit, above 0")
        self.input, self.output = Path(input), Path(output)
        self.examiner = examiner
        self.options: dict[str, Any] = {"intrinsics": intrinsics, "depth_scale": depth_scale}
        self.masks = None if masks is None else Path(masks)

    def run(self) -> dict[str, float]:
        """Examines all images; returns how many there are, how many are odd, and unusable.

        Raises:
            InputError: there is no image, or none is usable.
            StorageError: the output folder can't be written.
        """
        images = find_images(self.input)
        require_writable(self.output)
        base = self.input if self.input.is_dir() else self.input.parent
        found = []
        for image in images:
            found.append(self._examined(image))
            _tell(str(image.relative_to(base)), found[-1])
            if found[-1].frame is not None:
                picture = draw_examination(found[-1], self.examiner.grid)
                save_picture(picture, self.output / image.relative_to(base).with_suffix(".png"))
        bad = [one.checks[-1].line for one in found if not one.usable]
        if len(bad) == len(found):
            raise InputError(
                bad[0] if len(bad) == 1 else f"none of {len(bad)} images is usable: {bad[0]}"
            )
        odd = [one for one in found if one.usable and any(c.verdict == ODD for c in one.checks)]
        return {
            "images": float(len(found)),
            "odd": float(len(odd)),
            "unusable": float(len(bad)),
        }

    def _examined(self, image: Path) -> Examination:
        try:
            frame = read_frame(image, **self.options)
            mask = None
            if self.masks is not None:
                folder = self.masks.is_dir()
                path = self.masks / f"{image.stem}.png" if folder else self.masks
                mask = read_mask(path, frame.depth.shape)
        except InputError as error:
            return Examination((unusable("file", error),))
        return self.examiner.examine(frame, mask)


def _tell(name: str, found: Examination) -> None:
    """A line per check, with what helps below."""
    worst = {check.verdict for check in found.checks}
    verdict = UNUSABLE if UNUSABLE in worst else "usable, but odd" if ODD in worst else "usable"
    print(f"{name}: {verdict}")
    for check in found.checks:
        print(f"  {check.verdict:<9} {check.name:<11} {check.found}")
        if check.mend:
            print(f"  {'':<9} {'mend':<11} {check.mend}")
