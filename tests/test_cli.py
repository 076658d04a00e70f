"""What a user types, and what comes back: in processes of their own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

TASK = """
import gc
import os
from scenefw.core.errors import IncompleteError, InputError

class Task:
    def __init__(self, grid, output, seed: int = 0, trouble=""):
        self.grid, self.output, self.seed, self.trouble = grid, output, seed, trouble
        if trouble == "building":
            raise InputError("a value of 3 is\\nno good; give 4")

    def run(self):
        if self.trouble == "halfway":
            open(os.path.join(self.output, "half"), "w").close()
            raise InputError("no more")
        if self.trouble == "running":
            raise InputError("a value of 5 is no good; give 6")
        if self.trouble == "talking":
            from scenefw.core.files import replacing

            with replacing(os.path.join(self.output, "file")):
                print("step 1", flush=True)
        if self.trouble == "full":
            raise OSError(28, "No space left on device")  # as of `write`, which knows no name
        if self.trouble == "fault":
            raise ZeroDivisionError("a fault of the program")
        if self.trouble == "interrupt":
            raise KeyboardInterrupt
        if self.trouble == "partly":
            raise IncompleteError("1 of 2 images is unusable", {"images": 2})
        if self.trouble == "terminate":
            from pathlib import Path
            from scenefw.core.folders import replacing_folder

            with replacing_folder(Path(self.output) / "result"):
                os.kill(os.getpid(), 15)
        return {"extent": self.grid.extent, "seed": self.seed, "garbage": gc.isenabled()}
"""
CONFIG = """# A run that does nothing
_target_: scenefw_nil.Task
grid: ${grid}
output: ${paths.output}
seed: ${seed}
trouble: ''
"""
PROJECT = """
[project]
name = "scenefw-nil"
version = "1"
[project.entry-points."scenefw.plugins"]
nil = "scenefw_nil"
"""

BUFFERED = {**os.environ, "PYTHONUNBUFFERED": ""}  # output into a pipe is written when it is much


@pytest.fixture
def nil(tmp_path, scenefw):
    """A command line that has the option run=nil."""
    folder = tmp_path / "plugins" / "nil"
    (folder / "src" / "scenefw_nil").mkdir(parents=True)
    (folder / "conf" / "run").mkdir(parents=True)
    (folder / "src" / "scenefw_nil" / "__init__.py").write_text(TASK)
    (folder / "conf" / "run" / "nil.yaml").write_text(CONFIG)
    (folder / "pyproject.toml").write_text(PROJECT)
    return scenefw


def assert_one_line(done, *words):
    assert done.returncode == 2, done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 1, done.stderr
    for word in words:
        assert word in lines[0]


def test_help_names_commands_and_groups_without_torch(tmp_path):
    code = (
        "import sys; from scenefw.__main__ import main; main(['--help']);"
        "sys.exit(bool({'torch', 'numpy', 'hydra', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
    for word in ("experiment=simstack", "run=predict", "--list", "floor", "renderer"):
        assert word in done.stdout


@pytest.mark.exhaustive
def test_list_shows_every_option_with_its_description(nil):
    done = nil("--list")
    assert done.returncode == 0, done.stderr
    assert "A run that does nothing" in done.stdout
    assert "Walls, robots, furniture and containers, by their size" in done.stdout
    assert "nil" in next(line for line in done.stdout.splitlines() if "does nothing" in line)
    (row,) = (
        line for line in done.stdout.splitlines() if "Partial TSDFs from depth images" in line
    )
    assert "run=" in row
    assert "mapping" in row


def test_list_of_groups_shows_their_options_alone(nil):
    done = nil("--list", "run", "renderer")
    assert done.returncode == 0, done.stderr
    assert "run=nil: A run that does nothing" in done.stdout
    assert "${paths.output}" in done.stdout
    assert "renderer=" in done.stdout
    assert "Voxel grid" not in done.stdout
    assert_one_line(nil("--list", "run", "nonsense"), "no group 'nonsense'")


@pytest.mark.parametrize("folder", ["file", "file/within"])
def test_a_file_in_the_place_of_the_output_folder_is_called_so(nil, tmp_path, folder):
    (tmp_path / "file").touch()
    done = nil("run=nil", f"paths.output={folder}")
    assert_one_line(done, f"cannot use {folder}: file is a file, not a folder; give another path")


def test_a_group_of_a_plugin_says_what_it_is(nil, tmp_path):
    folder = tmp_path / "plugins" / "nil" / "conf" / "colour"
    folder.mkdir()
    (folder / "_group.yaml").write_text("about: What colours there are\nverbs: [nil]\n")
    (folder / "red.yaml").write_text("# Like roses\nhue: 0\n")
    done = nil("--list", "colour")
    assert done.returncode == 0, done.stderr
    for words in ("What colours there are", "run=nil", "colour=red: Like roses"):
        assert words in done.stdout
    assert "_group" not in nil("--help").stdout


@pytest.mark.parametrize("word", ["nonsense", "modle"])
def test_a_group_that_is_none_is_one_line(scenefw, word):
    assert_one_line(scenefw("--list", word), f"no group '{word}'", "did you mean")


@pytest.mark.parametrize(
    ("word", "unread"), [("--version", "stdout"), ("--help", "stdout and stderr")]
)
def test_nothing_is_said_where_nobody_reads(nil, tmp_path, word, unread):
    """As in `python -m scenefw --list | head`; what comes of cat and others there, too."""
    reader, writer = os.pipe()
    os.close(reader)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "scenefw", word],
            cwd=tmp_path,
            env=BUFFERED,
            stdout=writer,
            stderr=writer if "stderr" in unread else subprocess.PIPE,
            text=True,
            check=False,
        )
    finally:
        os.close(writer)
    assert done.returncode == 141, done.stderr
    assert not done.stderr


@pytest.mark.parametrize(
    ("trouble", "unread"), [("''", ["stdout"]), ("talking", ["stdout", "stderr"])]
)
def test_a_run_says_nothing_where_nobody_reads(nil, tmp_path, trouble, unread):
    words = ("run=nil", f"run.trouble={trouble}", "paths.output=out", "device=cpu")
    done = nil(*words, unread=unread)
    assert done.returncode == 141, done.stderr
    assert not done.stderr
    if (tmp_path / "out").exists():
        assert "file" not in " ".join(path.name for path in (tmp_path / "out").iterdir())


def test_errors_are_told_where_nobody_reads_the_output(nil):
    done = nil("run=nil", "run.trouble=building", "device=cpu", unread=["stdout"])
    assert_one_line(done, "give 4")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("word", ["--version", "--list"])
def test_output_on_a_full_disk_is_one_line(tmp_path, word):
    with Path("/dev/full").open("w") as full:
        words = [sys.executable, "-m", "scenefw", word]
        done = subprocess.run(
            words,
            cwd=tmp_path,
            env=BUFFERED,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert_one_line(done, "No space left")


def test_a_full_disk_is_one_line(nil, tmp_path):
    done = nil("run=nil", "run.trouble=full", "device=cpu", "paths.output=out")
    assert_one_line(done, "No space left on device", "paths.output=FOLDER")
    assert not (tmp_path / "out").exists()


def test_version(scenefw):
    assert scenefw("--version").stdout.startswith("scenefw 0.")


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("experiment=simstak", "simstack"),
        ("grid.resoluton=32", "grid.resolution"),
        ("seed=[1", "key=value"),
        ("run.trouble=schräg", "needs quotes of its own: \"run.trouble='schräg'\""),
        ("run.trouble=a,b", "\"run.trouble='a,b'\", several values are 'run.trouble=[a,b]'"),
        ("renderer=null", "~renderer"),
        ("paths.weights=${settling.x}", "no settling is chosen"),
        ("--quiet", "there is no option --quiet"),
    ],
)
def test_a_slip_of_the_pen_gets_one_line_with_near_misses(nil, typed, expected):
    assert_one_line(nil("run=nil", typed), expected)


def test_a_run_leaves_its_settings_versions_and_figures(nil, tmp_path):
    done = nil("run=nil", "seed=7", "device=cpu", "paths.output=out")
    assert done.returncode == 0, done.stderr
    out = tmp_path / "out"
    assert done.stdout.splitlines()[-1] == str(out)
    figures = json.loads((out / "metrics.json").read_text())
    assert figures == {"extent": 1.0, "seed": 7, "garbage": True}
    record = json.loads((out / "run.json").read_text())
    assert record["seed"] == 7
    assert {"python", "torch", "scenefw"} <= set(record["versions"])
    settings = (out / "config.yaml").read_text()
    assert "seed: 7" in settings
    assert "${" not in settings


def test_a_setting_may_point_to_others(nil, tmp_path):
    done = nil("-m", "run=nil", "run.grid=${grid}", "run.seed=${seed}", "seed=7", "device=cpu",
               "paths.output=out")  # fmt: skip
    assert done.returncode == 0, done.stderr
    [record] = (tmp_path / "out").rglob("run.json")
    typed = json.loads(record.read_text())["overrides"]
    assert any(word.startswith("run.grid=$") for word in typed)  # Hydra's sweeps escape braces
    figures = json.loads((record.parent / "metrics.json").read_text())
    assert figures["seed"] == 7


def test_a_sweep_gives_each_run_a_folder(nil, tmp_path):
    done = nil("run=nil", "--multirun", "seed=1,2", "device=cpu", "paths.output=out")
    assert done.returncode == 0, done.stderr
    for number, seed in enumerate((1, 2)):
        figures = json.loads((tmp_path / "out" / str(number) / "metrics.json").read_text())
        assert figures["seed"] == seed


@pytest.mark.exhaustive
@pytest.mark.parametrize("launcher", ["joblib", "submitit_local"])
def test_runs_of_a_sweep_side_by_side(nil, tmp_path, launcher):
    pytest.importorskip(f"hydra_plugins.hydra_{launcher.removesuffix('_local')}_launcher")
    words = ("-m", "run=nil", "seed=1,2", f"launcher={launcher}", "device=cpu", "paths.output=out")
    done = nil(*words)
    assert done.returncode == 0, done.stderr
    assert len(list((tmp_path / "out").glob("*/metrics.json"))) == 2


def test_an_error_in_a_sweep_is_one_line(nil):
    done = nil("-m", "run=nil", "run.trouble=running", "seed=1,2", "device=cpu")
    assert_one_line(done, "a value of 5", "(run 1 of 2 of the sweep, ", "seed=1; not started: 1)")


def test_what_could_be_done_is_kept_beside_an_error(nil, tmp_path):
    done = nil("run=nil", "run.trouble=partly", "paths.output=out")
    assert_one_line(done, "error: 1 of 2 images is unusable")
    assert done.stdout.splitlines()[-1] == str(tmp_path / "out")
    assert json.loads((tmp_path / "out" / "metrics.json").read_text()) == {"images": 2}


def test_a_sweep_goes_on_after_a_run_that_is_incomplete(nil, tmp_path):
    done = nil("-m", "run=nil", "run.trouble=partly,none", "device=cpu", "paths.output=out")
    assert_one_line(done, "error: 1 of 2 images is unusable")
    assert len(list((tmp_path / "out").glob("*/metrics.json"))) == 2


def test_the_home_is_put_into_paths(nil, tmp_path):
    done = nil("run=nil", "paths.output=~/blocks", "device=cpu", env={"HOME": str(tmp_path)})
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "blocks" / "metrics.json").is_file()


def test_v_shows_the_traceback(nil):
    done = nil("run=nil", "run.trouble=running", "-v", "device=cpu")
    assert done.returncode == 2
    assert "Traceback" in done.stderr
    assert done.stderr.splitlines()[-1] == "error: a value of 5 is no good; give 6"


def test_a_fault_of_the_program_keeps_its_traceback(nil):
    done = nil("run=nil", "run.trouble=fault", "device=cpu")
    assert done.returncode == 1
    assert "Traceback" in done.stderr


def test_an_interrupt_is_quiet_and_leaves_no_run(nil, tmp_path):
    done = nil("run=nil", "run.trouble=interrupt", "device=cpu")
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.rglob("run.json"))


def test_an_end_from_outside_leaves_no_temporary_folder(nil, tmp_path):
    done = nil("run=nil", "run.trouble=terminate", "device=cpu", "paths.output=out")
    assert done.returncode == 143
    assert done.stderr == "terminated\n"
    assert not (tmp_path / "out").exists()


def test_a_setting_without_a_value_is_one_line(nil, tmp_path):
    assert_one_line(nil("run=nil", "run.trouble="), "run.trouble= has no value; give run.trouble=V")
    assert not list(tmp_path.rglob("run.json"))


def test_a_missing_input_is_told_before_torch_is_imported(tmp_path):
    code = (
        "import sys\nfrom scenefw.__main__ import main\ntry: main(sys.argv[1:])\n"
        "except SystemExit as end: print(end.code, 'torch' in sys.modules)"
    )
    words = (sys.executable, "-c", code, "run=predict", "input=none.png")
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert (
        done.stderr == "error: no file or folder none.png; give input=PATH of one that is there\n"
    )
    assert done.stdout.split() == ["2", "False"]


def test_a_config_of_somebody_else_is_not_lost(nil, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "config.yaml").write_text("mine")
    assert_one_line(nil("run=nil", "paths.output=out"), "config.yaml is not of a run of scenefw")
    assert (tmp_path / "out" / "config.yaml").read_text() == "mine"


def test_a_run_that_makes_nothing_leaves_the_folder_as_it_was(nil, tmp_path):
    assert nil("run=nil", "run.trouble=running", "paths.output=out").returncode == 2
    assert not (tmp_path / "out").exists()
    assert nil("run=nil", "paths.output=out").returncode == 0
    (tmp_path / "out" / "page.html").write_text("a page")
    kept = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    for when in ("building", "fault"):
        assert nil("run=nil", f"run.trouble={when}", "seed=7", "paths.output=out").returncode > 0
        assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == kept


def test_figures_of_an_earlier_run_are_not_kept_beside_what_a_failed_one_made(nil, tmp_path):
    assert nil("run=nil", "paths.output=out").returncode == 0
    assert nil("run=nil", "run.trouble=halfway", "seed=7", "paths.output=out").returncode == 2
    found = {path.name for path in (tmp_path / "out").iterdir()}
    assert found == {"config.yaml", "run.json", "half"}
    assert json.loads((tmp_path / "out" / "run.json").read_text())["seed"] == 7


def test_a_word_for_a_number_is_named_before_anything_is_written(nil, tmp_path):
    done = nil("run=nil", "run.seed=many", "paths.output=out")
    assert_one_line(done, "run.seed is many", "expected a whole number")
    assert not (tmp_path / "out").exists()


def test_a_wrong_argument_is_named(nil):
    assert_one_line(nil("run=nil", "+run.depth=3", "device=cpu"), "depth")


def test_an_unwritable_output_folder_is_named_before_work_starts(nil):
    done = nil("run=nil", "run.trouble=fault", "paths.output=/proc/nowhere/out", "device=cpu")
    assert_one_line(done, "/proc/nowhere")


def test_an_unknown_device_is_named(nil):
    assert_one_line(nil("run=nil", "device=tpu"), "tpu")


@pytest.mark.parametrize(("word", "said", "unsaid"), [
    ("foo=1", "--cfg job lists all keys", "floor"),
    ("seeed=1", "did you mean seed?", "--cfg"),
    ("batch=1", "did you mean size.batch", "--cfg"),
])  # fmt: skip
def test_an_unknown_key_gets_hints_that_are_close(scenefw, word, said, unsaid):
    done = scenefw(word)
    assert_one_line(done, f"no key '{word.partition('=')[0]}'", said)
    assert unsaid not in done.stderr
