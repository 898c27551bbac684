"""One run of any controller, as a file or in a window; what cannot be shown is one line."""

import os
import sys
import tempfile

import pytest
from PIL import Image

from smo_gym.cli import animate, recording, watch
from smo_gym.envs import rendering
from smo_gym.policies.named import shipped

SHORT = ("--seconds", "0.2")


def frames(path):
    with Image.open(path) as image:
        return image.n_frames


@pytest.mark.parametrize(
    "arguments",
    [
        ["lqr", "--compensation", "off"],
        ["ppo", "--state", "1", "-0.5", "0", "0", "--uncertainty", "20%"],
        ["smc", "--params", "rod_length=0.6", "--observer", "oracle"],
        ["lqr", "--env", "SMOPendulumUpright-v0", "--case", "2"],
        ["smc-tracking", "--env", "SMOPendulumTracking-v0"],
    ],
)
def test_a_run_is_written(arguments, tmp_path, capsys):
    for name in ("run.gif", "new/run.webp"):
        assert watch.main([*arguments, *SHORT, "--out", str(tmp_path / name)]) == 0, capsys.readouterr().err
        assert frames(tmp_path / name) == 6
    assert "ends after 0.2 s" in capsys.readouterr().out


def test_a_video_is_written(tmp_path):
    pytest.importorskip("moviepy")
    assert watch.main([*SHORT, "--out", str(tmp_path / "run.mp4")]) == 0
    assert (tmp_path / "run.mp4").read_bytes()[4:8] == b"ftyp"


def test_a_trainings_folder_is_its_policy_in_its_environment(tmp_path, capsys):
    policy, out = shipped("SMOPendulumUpright-v0"), str(tmp_path / "run.gif")
    policy.save(tmp_path / "best.safetensors")
    assert watch.main([str(tmp_path), *SHORT, "--out", out]) == 2
    assert f"the best policy so far: smo-gym watch {tmp_path / 'best.safetensors'}" in capsys.readouterr().err
    policy.save(tmp_path / "policy.safetensors")
    assert watch.main([str(tmp_path), *SHORT, "--out", out]) == 0
    assert "in SMOPendulumUpright-v0" in capsys.readouterr().out


def test_a_window_shows_it_until_somebody_closes_it(monkeypatch, capsys):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    assert watch.main([*SHORT]) == 0
    assert "ends after 0.2 s" in capsys.readouterr().out
    monkeypatch.setattr(watch, "closed_by_user", lambda: True)
    assert watch.main([*SHORT]) == 0
    assert "was closed after 0.001 s" in capsys.readouterr().out


def test_a_request_to_close_is_seen(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = rendering.load()
    assert not rendering.closed_by_user()
    pygame.display.init()
    try:
        pygame.event.post(pygame.event.Event(pygame.QUIT))
        assert rendering.closed_by_user()
    finally:
        pygame.display.quit()


def interrupted_at(instant, monkeypatch):
    """Ctrl-C in the middle of a run."""
    run = recording.run

    def cut(*arguments):
        for k, instant_ in enumerate(run(*arguments)):
            if k == instant:
                raise KeyboardInterrupt
            yield instant_

    monkeypatch.setattr(recording, "run", cut)


@pytest.mark.parametrize("kind", [".gif", ".webp", ".mp4"])
@pytest.mark.parametrize("before", [None, b"an older film"])
def test_an_interrupted_recording_is_one_line_and_leaves_what_was_there(kind, before, tmp_path, monkeypatch, capsys):
    if kind == ".mp4":
        pytest.importorskip("moviepy")
    film = tmp_path / f"run{kind}"
    if before:
        film.write_bytes(before)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    interrupted_at(100, monkeypatch)
    for command in (watch, animate) if kind != ".mp4" else (watch,):
        assert command.main([*SHORT, "--out", str(film)]) == 130
        name = command.__name__.rpartition(".")[2]
        assert capsys.readouterr() == ("", f"smo-gym {name}: interrupted, nothing was written\n")
        assert [*tmp_path.iterdir()] == ([film] if before else [])
        assert before is None or film.read_bytes() == before


def test_an_interruption_while_the_film_is_written_leaves_no_half_of_it(tmp_path, monkeypatch, capsys):
    def interrupt(descriptor):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    assert watch.main([*SHORT, "--out", str(tmp_path / "run.gif")]) == 130
    assert capsys.readouterr() == ("", "smo-gym watch: interrupted, nothing was written\n")
    assert not list(tmp_path.iterdir())


def test_an_interrupted_window_is_one_line(monkeypatch, capsys):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    interrupted_at(20, monkeypatch)
    assert watch.main([*SHORT]) == 130
    assert capsys.readouterr().err == "smo-gym watch: interrupted, nothing was written\n"
    assert not rendering.load().display.get_init()


def test_no_display_is_one_line(monkeypatch, capsys):
    def none(renderer):
        raise RuntimeError("render_mode='human' needs a display (SDL found no screen): use another")

    monkeypatch.setattr(rendering.Renderer, "_open", none)
    assert watch.main([*SHORT]) == 2
    message = "no window can be shown (SDL found no screen): say --out FILE.gif, .webp or .mp4"
    assert capsys.readouterr().err == f"smo-gym watch: error: {message}\n"


def test_a_missing_extra_is_named_before_the_run(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "moviepy.video.io.ffmpeg_writer", None)
    monkeypatch.setattr(recording, "run", None)
    assert watch.main(["--out", str(tmp_path / "run.mp4")]) == 2
    assert 'pip install "smo_gym[video]"' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["lqg"], "unknown controller of SMOPendulum-v0 'lqg': did you mean 'lqr'?"),
        (["."], "is no training's folder"),
        (["--env", "SMOPendulum-v1"], "did you mean 'SMOPendulum-v0'?"),
        (["ppo", "--env", "SMOPendulumTracking-v0"], "no policy is shipped for SMOPendulumTracking-v0"),
        (["--state", "6", "0", "0", "0"], "h=6 must be from -5 to 5"),
        (["--state", "0", "2", "0", "0", "--env", "SMOPendulumUpright-v0"], "theta=2 must be from -1.571 to 1.571"),
        (["--state", "nan", "0", "0", "0"], "'nan' must be a finite number"),
        (["--state", "0", "0", "0", "0", "--case", "1"], "give one of them"),
        (["--case", "5"], "unknown case of SMOPendulum-v0 '5'"),
        (["--params", "rod"], "'rod' must be NAME=X"),
        (["--params", "rod_lenght=1"], "did you mean 'rod_length'?"),
        (["--observer", "oracle", "--compensation", "on"], "is for the observer smo"),
        (["--seconds", "1e3"], "--seconds=1000.0 must be"),
        (["--out", "run.gfi"], "unknown kind of file '.gfi': did you mean '.gif'?"),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert watch.main(["--out", "run.gif", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not list(tmp_path.iterdir())
