"""Checks depth images as a prediction would, and suggests fixes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scenefw.core.errors import IncompleteError, InputError
from scenefw.core.files import require_apart, require_writable
from scenefw.perception.observation.doctor import ODD, UNUSABLE, unusable
from scenefw.report.pictures import save_picture
from scenefw.tasks.depth_images import DepthImages
from scenefw_doctor.examination import Examination
from scenefw_doctor.pictures import draw_examination

if TYPE_CHECKING:
    from scenefw_doctor.examination import Examiner


class Examine:
    """Prints a verdict per check of each image, with a fix, and draws what is seen of it.

    The pictures are `NAME.png` in the output folder.

    Args:
        input: a depth image or a folder of them.
        examiner: makes the checks.
        output: where the pictures go.
        intrinsics: file with the intrinsics of .png and .npy images; None looks beside them.
        depth_scale: metres per unit of integer depth; None = that of the format, else millimetres.
        masks: as of `run=predict`.

    Raises:
        ConfigError: no input is given, the depth scale is not positive, or pictures would go among
            the images or masks, where they would replace those of the same name.
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
        self.images = DepthImages("doctor", input, intrinsics, depth_scale, masks, output)
        for path in [Path(source) for source in (input, masks) if source is not None]:
            require_apart(output, path if path.is_dir() else path.parent)
        self.output, self.examiner = Path(output), examiner

    def run(self) -> dict[str, float]:
        """Examines all images; returns how many there are, how many are odd, and unusable.

        Raises:
            InputError: there is no image, or none is usable.
            IncompleteError: some are unusable, so that a script can tell by the status.
            StorageError: the output folder can't be written.
        """
        images = self.images.find()
        require_writable(self.output)
        examinations = []
        for image in images:
            examinations.append(self._examined(image))
            name = self.images.name(image)
            _tell(str(name), examinations[-1])
            if examinations[-1].frame is not None:
                picture = draw_examination(examinations[-1], self.examiner.grid)
                save_picture(picture, self.output / name.with_suffix(".png"))
        bad = [_reason(examination) for examination in examinations if not examination.usable]
        if len(bad) == len(examinations):
            raise InputError(
                bad[0] if len(bad) == 1 else f"none of {len(bad)} images is usable: {bad[0]}"
            )
        odd_examinations = [
            examination
            for examination in examinations
            if examination.usable and any(c.verdict == ODD for c in examination.checks)
        ]
        figures = {
            "images": float(len(examinations)),
            "odd": float(len(odd_examinations)),
            "unusable": float(len(bad)),
        }
        if bad:
            words = "is" if len(bad) == 1 else "are"
            raise IncompleteError(
                f"{len(bad)} of {len(examinations)} images {words} unusable, see above", figures
            )
        return figures

    def _examined(self, image: Path) -> Examination:
        try:
            frame, mask = self.images.read(image)
        except InputError as error:
            return Examination((unusable("file", error),))
        return self.examiner.examine(frame, mask)


def _reason(examination: Examination) -> str:
    """Why an image is unusable, in one line; further checks may have been good."""
    return next(check.line for check in examination.checks if check.verdict == UNUSABLE)


def _tell(name: str, examination: Examination) -> None:
    """A line per check, with what helps below."""
    worst = {check.verdict for check in examination.checks}
    verdict = UNUSABLE if UNUSABLE in worst else "usable, but odd" if ODD in worst else "usable"
    print(f"{name}: {verdict}")
    for check in examination.checks:
        print(f"  {check.verdict:<9} {check.name:<11} {check.found}")
        if check.fix:
            print(f"  {'':<9} {'fix':<11} {check.fix}")
