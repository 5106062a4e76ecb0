"""Changed sources of one version are noticed where results are added to, and nowhere else."""

import shutil

import pytest
import toy

from mcsettle.errors import InputError
from mcsettle.run import code_digest as module
from mcsettle.run import pipeline, status
from mcsettle.run.close import gather
from mcsettle.run.pipeline import run_study
from mcsettle.run.status import survey
from mcsettle.summary.results import read_results

pytestmark = pytest.mark.usefixtures("fresh_cache")


def test_the_digest_is_that_of_names_and_bytes(tmp_path, monkeypatch):
    names = module._sources()
    assert {"step_b/engine.py", "kernels/spectral.py", "data/grounds.toml"} & set(names) != set()
    assert not {name for name in names if name.startswith(("report/", "cli/", "analysis/"))}
    first = module.code_digest()
    copy = tmp_path / "engine.py"
    for data in (b"changed", names["step_b/engine.py"].read_bytes()):
        copy.write_bytes(data)
        monkeypatch.setattr(module, "_sources", lambda: names | {"step_b/engine.py": copy})
        module.code_digest.cache_clear()
        assert (module.code_digest() == first) == (data != b"changed")
    monkeypatch.undo()
    module.code_digest.cache_clear()


def test_a_run_does_not_go_on_with_other_code(tmp_path, monkeypatch):
    study = toy.study(run={"realisations": 2})
    folder = run_study(study, tmp_path / "out").folder
    shutil.copytree(folder, tmp_path / "copy")
    for room in (pipeline, status):
        monkeypatch.setattr(room, "code_digest", lambda: "ef" * 32)
    with pytest.raises(InputError, match=r"code digest [0-9a-f]{64} where this run has efef"):
        run_study(study, folder)
    with pytest.raises(InputError, match="was computed by other sources of mcsettle"):
        gather(folder)
    assert survey(folder).finished  # it is still read
    assert len(read_results(folder).realisations) == 4


def test_a_folder_of_another_version_is_not_gathered(tmp_path, monkeypatch):
    folder = run_study(toy.study(run={"realisations": 2}), tmp_path / "out").folder
    monkeypatch.setattr(status.mcsettle, "__version__", "0.0.9")
    with pytest.raises(InputError, match=r"is of mcsettle .*, this is 0\.0\.9"):
        gather(folder)
