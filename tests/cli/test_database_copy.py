"""`kpred database copy`: the numbers, a second run, and places that cannot be used."""

from kpred.cli.main import USAGE, main


def test_a_copy_is_counted_compared_and_goes_on(files, tmp_path, run_json, refusal, capsys):
    target = tmp_path / "copy.kpred"
    first = run_json("database", "copy", files / "tables.kpred", target, "--batch", 3)
    assert (first["copied"], first["present"], first["verified"]) == (8, 0, 8)
    second = run_json("database", "copy", files / "tables.kpred", target)
    assert (second["copied"], second["present"], second["verified"]) == (0, 8, 8)
    known, copied = (run_json("database", "info", file)["categories"] for file in (files / "tables.kpred", target))
    assert copied == known
    assert [file.name for file in tmp_path.iterdir()] == ["copy.kpred"]
    assert "does not exist" in refusal("database", "copy", tmp_path / "none.kpred", target)
    assert "cannot be reached" in refusal("database", "info", "postgresql://nobody@localhost:1/x")
    assert main(["database", "copy", str(target), str(tmp_path / "b"), "--batch", "0"]) == USAGE
    assert "--batch" in capsys.readouterr().err
