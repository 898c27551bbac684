"""Frames: what is drawn is where the equations put it; windows only where there is a display."""

import copy
import os
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.wrappers import RecordVideo
from PIL import Image, ImageColor

import smo_gym
from smo_gym import ObserverWrapper
from smo_gym.cli import animate
from smo_gym.envs import rendering

WIDTH, HEIGHT = rendering.SIZE


def frame_of(id="SMOPendulum-v0", state=(0.0, 0.0, 0.0, 0.0), force=None, observer=None, **options):
    env = gymnasium.make(id, render_mode="rgb_array", uncertainty=0.0, **options)
    env = ObserverWrapper(env, **observer) if observer is not None else env
    env.reset(options={"state": state})
    if force is not None:
        env.step(np.array([force]))
    return env.render(), env.unwrapped


def pixels(frame, colour, below=40):
    """Rows and columns of a colour, the captions at the top left out."""
    rows, columns = np.nonzero((np.abs(frame[below:].astype(int) - ImageColor.getrgb(colour)) <= 6).all(axis=2))
    return rows + below, columns


def middle(frame, colour):
    rows, columns = pixels(frame, colour)
    return (columns.min() + columns.max()) / 2, (rows.min() + rows.max()) / 2


def test_frames_are_images(env_id):
    env = gymnasium.make(env_id, render_mode="rgb_array")
    env.reset(seed=0)
    frame = env.render()
    assert (frame.shape, frame.dtype) == ((HEIGHT, WIDTH, 3), np.uint8)
    assert frame.flags.writeable
    assert (env.render() == frame).all()
    env.step(np.array([20.0]))
    assert (env.render() != frame).any()
    env.close()
    env.close()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_draws_for_itself(copied):
    env = ObserverWrapper(gymnasium.make("SMOPendulum-v0", render_mode="rgb_array"))
    env.reset(seed=0)
    twin, before = copied(env), env.render()
    twin.step(np.array([20.0]))
    assert (env.render() == before).all()
    env.step(np.array([20.0]))
    assert (env.render() == twin.render()).all()


@pytest.mark.parametrize("gravity", [-9.8, 9.8])
def test_the_bob_moves_as_the_energy_says(gravity):
    """Kinetic and potential energy of cart and bob, as they are drawn, are those of equation (53)."""
    env = gymnasium.make("SMOPendulum-v0", params={"gravity": gravity}).unwrapped
    plant, rng, dt = env.task.params, np.random.default_rng(0), 1e-6
    for x in rng.uniform(-2, 2, (20, 4)):
        place = [np.array(rendering.bob(env.task, x[:2] + s * dt * x[2:], plant.rod_length)) for s in (-1, 0, 1)]
        velocity = (place[2] - place[0]) / (2 * dt)
        kinetic = 0.5 * plant.cart_mass * x[2] ** 2 + 0.5 * plant.bob_mass * velocity @ velocity
        assert kinetic + plant.bob_mass * 9.8 * place[1][1] == pytest.approx(float(plant.energy(x)), abs=1e-7)


@pytest.mark.parametrize(("id", "up"), [("SMOPendulum-v0", -1), ("SMOPendulumUpright-v0", 1)])
@pytest.mark.parametrize("theta", [0.0, 0.4, -1.2])
def test_the_bob_is_drawn_where_it_is(id, up, theta):
    h, scale = 0.3, WIDTH / (8 * 0.44)  # pixels a metre: a frame is eight rods wide
    frame, _ = frame_of(id, (h, theta, 0, 0))
    x, y = middle(frame, rendering.BOB)
    assert x == pytest.approx(WIDTH / 2 + scale * (h + 0.44 * np.sin(theta)), abs=1.5)
    assert y == pytest.approx(HEIGHT / 2 - scale * up * 0.44 * np.cos(theta), abs=1.5)


def test_the_rod_is_this_episodes(env_id):
    env = gymnasium.make(env_id, render_mode="rgb_array")
    env.reset(options={"state": (0, 0, 0, 0), "params": {"rod_length": 0.6}})
    _, y = middle(env.render(), rendering.BOB)
    assert abs(y - HEIGHT / 2) == pytest.approx(WIDTH / (8 * 0.44) * 0.6, abs=1.5)


def test_the_frame_goes_along_with_the_cart_to_the_end_of_the_track():
    frame, _ = frame_of(state=(4.9, 0, 0, 0))
    x, _ = middle(frame, rendering.BOB)
    assert x == pytest.approx(0.75 * WIDTH, abs=1.5)
    ends = np.nonzero((frame[HEIGHT // 2 + 22] < 60).all(axis=1))[0]
    assert ends[ends > x + 10].mean() == pytest.approx(x + 0.1 * WIDTH / (8 * 0.44), abs=2)


def test_the_force_is_an_arrow():
    for force in (30.0, -15.0):
        frame, env = frame_of(force=force)
        _, columns = pixels(frame, rendering.FORCE)
        assert np.ptp(columns) == pytest.approx(abs(force) / 30 * 1.5 * WIDTH / 8, rel=0.05)  # of eight rods
        cart = WIDTH / 2 + WIDTH / (8 * 0.44) * env.loop.x[0, 0]
        assert (columns > cart).all() if force > 0 else (columns < cart).all()
    assert not pixels(frame_of(force=0.0)[0], rendering.FORCE)[0].size


@pytest.mark.parametrize("side", [1, -1])
def test_the_whole_arrow_is_in_sight_at_the_edge_of_the_middle_half(side):
    frame, _ = frame_of(state=(side * 2.5, 0, 0, 0), force=side * 30.0)
    _, columns = pixels(frame, rendering.FORCE)
    assert np.ptp(columns) == pytest.approx(1.5 * WIDTH / 8, rel=0.05)
    assert 5 < columns.min() < columns.max() < WIDTH - 5


def test_the_estimate_is_a_ghost_only_where_there_is_one():
    state, guess = (0.5, 0.0, 0, 0), (-0.5, 0.3, 0, 0)
    assert not pixels(frame_of(state=state)[0], rendering.ESTIMATE, below=0)[0].size
    frame, _ = frame_of(state=state, observer={"xhat0": guess})
    rows, columns = pixels(frame, rendering.ESTIMATE)
    scale = WIDTH / (8 * 0.44)
    ring = columns[rows > rows.max() - 3].mean()  # the lowest point of the bob's outline
    assert ring == pytest.approx(WIDTH / 2 + scale * (-0.5 + 0.44 * np.sin(0.3)), abs=2)
    assert columns.max() < WIDTH / 2 - scale * 0.2


def test_the_reference_is_drawn_where_there_is_one():
    assert not pixels(frame_of()[0], rendering.REFERENCE, below=0)[0].size
    frame, _ = frame_of("SMOPendulumTracking-v0", (0.0, 0, 0, 0))
    _, columns = pixels(frame, rendering.REFERENCE)
    assert columns.min() > WIDTH / 2 + WIDTH / (8 * 0.44) * 0.8  # it begins at h = 1 m


@pytest.mark.parametrize("state", [(np.nan,) * 2, (1e300, -np.inf)])
def test_a_diverged_state_or_estimate_is_still_a_frame(state):
    task = gymnasium.make("SMOPendulum-v0").unwrapped.task
    scene = rendering.Scene(0.0, np.array(state), 0.4, np.nan, None)
    assert rendering.Renderer("rgb_array", task).draw(scene, np.array(state)).shape == (HEIGHT, WIDTH, 3)


@pytest.mark.parametrize("mode", rendering.MODES)
def test_the_ghost_is_of_the_same_instant_as_the_state(mode, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    seen = []
    draw = rendering.Renderer.draw
    monkeypatch.setattr(rendering.Renderer, "draw", lambda *a: (seen.append(a[1:]), draw(*a))[1])
    env = ObserverWrapper(gymnasium.make("SMOPendulumTracking-v0", render_mode=mode))
    observation, _ = env.reset(seed=0)
    for k in range(4):
        assert (env.render() is None) == (mode == "human")
        scene, ghost = seen[-1]
        assert (scene.position[:2] == observation[:2]).all()
        assert (scene.desired == observation[2:6]).all()
        assert (ghost == observation[-4:]).all()
        assert scene.time == pytest.approx(0.02 * k)
        observation, *_ = env.step(np.array([7.0]))
        assert len(seen) == (2 * k + 3 if mode == "human" else k + 1)  # a window is drawn once by each step
    env.close()
    env.close()


def test_a_window_keeps_real_time_with_a_short_control_period(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    drawn = []
    frame = rendering.Renderer._frame
    monkeypatch.setattr(rendering.Renderer, "_frame", lambda *a: (drawn.append(a[1].time), frame(*a))[1])
    env = gymnasium.make("SMOPendulum-v0", render_mode="human", control_period=0.001)
    assert env.metadata["render_fps"] == 1000
    for _ in range(2):
        env.reset(seed=0)
        for _ in range(61):
            env.step(np.zeros(1))
    assert drawn == pytest.approx([0.0, 0.02, 0.04, 0.06] * 2)
    env.close()


def test_a_video_can_be_recorded(tmp_path):
    pytest.importorskip("moviepy")
    env = ObserverWrapper(gymnasium.make("SMOPendulum-v0", render_mode="rgb_array", horizon=0.2))
    env = RecordVideo(env, str(tmp_path / "videos"), disable_logger=True)
    env.reset(seed=0)
    while not env.step(np.zeros(1))[3]:
        pass
    env.close()
    assert env.frames_per_sec == 50
    (video,) = (tmp_path / "videos").iterdir()
    assert video.suffix == ".mp4"
    assert video.stat().st_size > 1000


def python(code, **environment):
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("SDL", "DISPLAY", "WAYLAND"))}
    command = [sys.executable, "-c", f"import gymnasium, os, smo_gym\nbefore = dict(os.environ)\n{code}"]
    return subprocess.run(command, capture_output=True, text=True, env=kept | environment, check=False)


def test_no_display_is_needed_or_it_is_said():
    make = 'gymnasium.make("SMOPendulum-v0", render_mode={!r})'
    done = python(f"env = {make.format('human')}\nprint('made')\nenv.reset()")
    assert done.stdout == "made\n"
    assert "RuntimeError: render_mode='human' needs a display" in done.stderr
    assert "use render_mode='rgb_array'" in done.stderr
    done = python(
        f"env = {make.format('rgb_array')}\nenv.reset()\nenv.render()\nimport pygame\n"
        "assert not pygame.display.get_init()\nassert dict(os.environ) == before"
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr  # and without pygame's greeting


def test_a_missing_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    env = gymnasium.make("SMOPendulum-v0", render_mode="rgb_array")  # as make_vec_env of Stable-Baselines3 asks for
    env.reset()
    env.step(np.zeros(1))
    with pytest.raises(ImportError, match=r'pip install "smo_gym\[render\]"'):
        env.render()


def test_rendering_without_a_mode_or_an_episode_is_refused():
    env = gymnasium.make("SMOPendulum-v0").unwrapped
    env.reset()
    with pytest.warns(UserWarning, match="render_mode="):
        assert env.render() is None
    with pytest.raises(ResetNeeded, match="before render"):
        gymnasium.make("SMOPendulum-v0", render_mode="rgb_array").unwrapped.render()


def test_an_animation_is_written(tmp_path, capsys):
    for name in ("run.gif", "new/run.webp"):
        assert animate.main(["--seconds", "0.4", "--out", str(tmp_path / name)]) == 0
        with Image.open(tmp_path / name) as image:
            assert (image.n_frames, image.size) == (11, rendering.SIZE)
    for bad, message in (
        (["--out", str(tmp_path / "run.gfi")], "unknown kind of file '.gfi': did you mean '.gif'?"),
        (["--controller", "lqg"], "unknown controller 'lqg': did you mean 'lqr'?"),
        (["--seconds", "-1"], "--seconds=-1.0 must be a finite number"),
    ):
        assert animate.main(bad) == 2
        assert message in capsys.readouterr().err


def test_smo_gym_does_not_import_pygame_by_itself():
    assert python("import sys\nassert 'pygame' not in sys.modules").returncode == 0
    assert smo_gym.__version__


def test_a_batch_is_drawn_slot_by_slot_as_its_scalar_environments_are(make_vec):
    envs = smo_gym.VectorObserverWrapper(make_vec(2, render_mode="rgb_array"))
    envs.reset(seed=3)
    for _ in range(5):
        envs.step(np.full((2, 1), 20.0))
    frames = envs.render()
    for i, frame in enumerate(frames):
        env = smo_gym.ObserverWrapper(gymnasium.make("SMOPendulum-v0", render_mode="rgb_array"))
        env.reset(seed=3 + i)
        for _ in range(5):
            env.step(np.full(1, 20.0))
        assert np.array_equal(frame, env.render())
    with pytest.raises(ValueError, match="a batch has no window"):
        make_vec(2, render_mode="human")


def test_a_batch_makes_a_video(make_vec, tmp_path):
    pytest.importorskip("moviepy")
    envs = gymnasium.wrappers.vector.RecordVideo(
        make_vec(2, render_mode="rgb_array", horizon=0.1), str(tmp_path / "videos"), episode_trigger=lambda k: True
    )
    envs.reset(seed=0)
    for _ in range(6):
        envs.step(np.zeros((2, 1)))
    envs.close()
    assert [path.suffix for path in (tmp_path / "videos").iterdir()]


def test_crosses_show_what_a_sensor_says_where_it_is_not_exact():
    said = np.array([0.5, 0.4])
    frame, env = frame_of(sensor={"bias": said}, state=(0.0, 0.0, 0.0, 0.0))
    rows, columns = pixels(frame, rendering.MEASURED)
    for point in ((said[0], 0.0), rendering.bob(env.task, said, env.task.params.rod_length)):
        x, y = rendering.to_pixel(env.task, np.zeros(4), point)
        near = (np.abs(rows - y) < 10) & (np.abs(columns - x) < 10)
        assert np.mean(columns[near]) == pytest.approx(x, abs=1.5)
        assert np.mean(rows[near]) == pytest.approx(y, abs=1.5)
    vector = gymnasium.make_vec("SMOPendulum-v0", 1, render_mode="rgb_array", sensor={"bias": said}, uncertainty=0.0)
    vector.reset(options={"state": np.zeros(4)})
    assert (vector.render()[0] == frame).all()
    assert not pixels(frame_of()[0], rendering.MEASURED)[0].size
