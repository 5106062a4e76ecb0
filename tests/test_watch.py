"""A change of a file is seen before it is made, wherever it is made from."""

import json
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import json, os, pathlib, shutil, sys
sys.path.insert(0, sys.argv[1])
from watch import Watch, is_below
seen = []
watch = Watch(lambda event, paths: seen.append([event, [is_below(p, [root]) for p in paths]]))
root = pathlib.Path(sys.argv[2])
watch.on = True
(root / "a").write_text("x")
(root / "a").read_text()
os.replace(root / "a", root / "b")
(root / "d").mkdir()
(root / "d" / "link").symlink_to("/etc")
os.truncate(root / "b", 0)
shutil.rmtree(root / "d")
os.chdir(root)
os.remove("b")
watch.on = False
(root / "c").touch()
json.dump(seen, sys.stdout)
"""


def test_every_change_is_seen_and_where_it_is(tmp_path):
    program = [sys.executable, "-c", PROGRAM, str(Path(__file__).parent), str(tmp_path)]
    done = subprocess.run(program, capture_output=True, text=True, check=True)
    seen = json.loads(done.stdout)
    assert all(all(below) for _, below in seen)
    assert [event for event, _ in seen] == [
        "open", "os.rename", "os.mkdir", "os.symlink", "os.truncate", "os.remove", "os.rmdir", "os.remove"
    ]  # fmt: skip
