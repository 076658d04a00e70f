"""What reading a picture from outside may raise."""

from PIL import Image

from scenefw.core.files import DAMAGED

DAMAGED_PICTURE = (*DAMAGED, Image.DecompressionBombError)
"""As `DAMAGED`, and of pictures so large that PIL takes them for an attack."""
