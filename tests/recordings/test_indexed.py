"""A file that is not the one that its index names is not used, whether it lies there or was downloaded."""

import hashlib
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from smo_gym.recordings import CART_POLE, indexed, load
from smo_gym.recordings.indexed import fetch

TEXT = "time,angle,position,Q\n0,0,0,0\n0.02029,0,0,0\n"
SUM = hashlib.sha256(TEXT.encode()).hexdigest()


def listed(folder, sha256=SUM, columns="file,sha256,bytes,repository,commit,path"):
    folder.mkdir(exist_ok=True)
    line = f"cartpole/test/a.csv,{sha256},9,someone/something,abc,Recordings V1/a.csv"
    (folder / "index.csv").write_text(f"{columns}\n{line}\nqube/LICENSE,0,9,else/where,abc,LICENSE\n")
    return folder


@pytest.fixture
def served(tmp_path, monkeypatch):
    """A server that has the file where the repository would."""

    class Handler(SimpleHTTPRequestHandler):
        def log_message(self, *args):
            pass

    root = tmp_path / "served"
    place = root / "someone" / "something" / "abc" / "Recordings V1"
    place.mkdir(parents=True)
    (place / "a.csv").write_text(TEXT)
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=root)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setattr(indexed, "FROM", f"http://127.0.0.1:{server.server_address[1]}")
        yield place / "a.csv"
        server.shutdown()


def test_what_is_fetched_is_loaded(tmp_path, served):
    folder = listed(tmp_path / "data")
    fetch(CART_POLE, folder)
    assert [run.name for run in load(CART_POLE, folder, "test")] == ["a"]
    served.unlink()
    fetch(CART_POLE, folder)  # it is there


def test_a_download_of_another_hash_is_not_kept(tmp_path, served):
    folder = listed(tmp_path / "data", "0" * 64)
    with pytest.raises(ValueError, match=r"cartpole/test/a\.csv: cannot be had as it was .*hash"):
        fetch(CART_POLE, folder)
    assert not [*folder.rglob("a.csv")]


def test_what_is_not_served_is_named(tmp_path, served):
    served.unlink()
    with pytest.raises(ValueError, match=r"cartpole/test/a\.csv: cannot be had .*404"):
        fetch(CART_POLE, listed(tmp_path / "data"))


def test_a_file_that_differs_is_refused_and_left_alone(tmp_path, served):
    folder = listed(tmp_path / "data")
    (folder / "cartpole" / "test").mkdir(parents=True)
    mine = folder / "cartpole" / "test" / "a.csv"
    mine.write_text(TEXT + "# mine\n")
    for use in (lambda: load(CART_POLE, folder, "test"), lambda: fetch(CART_POLE, folder)):
        with pytest.raises(ValueError, match=r"a\.csv: is not the file that index.csv names .*nothing is used"):
            use()
    assert mine.read_text().endswith("# mine\n")
    assert len(load(CART_POLE, folder, "test", checked=False)) == 1
    assert len(load(CART_POLE, mine)) == 1


def test_a_file_that_the_index_names_must_be_there(tmp_path):
    folder = listed(tmp_path / "data")
    with pytest.raises(ValueError, match=r"a\.csv: .*index\.csv names it and it cannot be read .*: fetch it"):
        load(CART_POLE, folder, "test")


def test_an_index_must_be_one(tmp_path):
    with pytest.raises(ValueError, match=r"index\.csv: lacks the column 'sha256'"):
        load(CART_POLE, listed(tmp_path / "data", columns="file,hash,bytes,repository,commit,path"), "test")
    with pytest.raises(ValueError, match="must say of the files in cartpole/ their file, sha256, repository"):
        fetch(CART_POLE, tmp_path)
