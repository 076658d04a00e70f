"""What Hydra reads is parsed once per process of the tests, not once per composition.

Hydra parses some seventy files for every composition, of which the tests make hundreds, and each
reference whenever it is resolved. A file is parsed anew when it changes; all else is left to Hydra
(see `tests/test_parsed.py`).
"""

import functools
import pickle
from pathlib import Path

from hydra._internal.sources_registry import SourcesRegistry
from hydra.core.plugins import Plugins
from hydra.plugins.config_source import ConfigResult
from omegaconf import base

Plugins.instance()  # looks for Hydra's plugins, which loads its own sources of files anew
FileConfigSource = SourcesRegistry.instance().resolve("file")
LOAD = FileConfigSource.load_config
PARSE = base.parse
_parsed = {}


def load_config(source, config_path):
    """What Hydra's own method gives; its result is changed by whoever asks, so it is copied."""
    path = (Path(source.path) / source._normalize_file_name(config_path)).resolve()
    try:
        found = path.stat()
    except OSError:
        return LOAD(source, config_path)
    key = (path, found.st_mtime_ns, found.st_size, found.st_ino)
    if key not in _parsed:
        found = LOAD(source, config_path)
        _parsed[key] = pickle.dumps((found.config, found.header))  # a fifth of the time of deepcopy
    config, header = pickle.loads(_parsed[key])
    return ConfigResult(
        provider=source.provider,
        path=f"{source.scheme()}://{source.path}",
        config=config,
        header=header,
    )


def install():
    FileConfigSource.load_config = load_config
    base.parse = functools.cache(PARSE)  # trees of references, which nobody changes


def read(folder):
    """Parses all settings in a folder in advance."""
    source = FileConfigSource("main", str(folder))
    for path in sorted(folder.rglob("*.yaml")):
        load_config(source, str(path.relative_to(folder)))
