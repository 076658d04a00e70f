from scenefw.tasks.run import claim


def test_runs_of_the_same_second_have_folders_of_their_own(tmp_path):
    wanted = tmp_path / "12-30-00"
    wanted.mkdir()
    folders = [claim(wanted) for _ in range(3)]
    assert [folder.name for folder in folders] == ["12-30-00", "12-30-00-2", "12-30-00-3"]
    assert all((folder / "run.json").is_file() for folder in folders)
