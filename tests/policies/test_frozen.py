"""Frozen policies: the same actions as the library's, and files that are checked."""

import json
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
import torch
from safetensors.numpy import load_file
from safetensors.torch import save as tensor_bytes
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO

from smo_gym import ObserverWrapper
from smo_gym.learning.settings import Run, built
from smo_gym.learning.training import frozen
from smo_gym.policies import MlpPolicy, shipped
from smo_gym.policies.forward import affine
from smo_gym.policies.frozen import Card, LstmPolicy
from smo_gym.wrappers.view import KINDS, UNITS, agent_view

SMALL = {
    "policy": "MlpPolicy",
    "n_steps": 8,
    "batch_size": 8,
    "policy_kwargs": {"net_arch": [16, 8]},
}
RECURRENT = {
    "policy": "MlpLstmPolicy",
    "n_steps": 8,
    "batch_size": 8,
    "policy_kwargs": {"net_arch": [8], "lstm_hidden_size": 12},
}


def untrained(observation="smo", algorithm="ppo", **options):
    """A model with random weights that move the force, and its frozen policy."""
    hyperparameters = RECURRENT if algorithm == "recurrent" else SMALL
    run = Run("SMOPendulum-v0", observation, algorithm, 0, 64, 1, options, hyperparameters)
    env = agent_view(gymnasium.make(run.environment, **options), observation)
    model = (RecurrentPPO if algorithm == "recurrent" else PPO)(env=env, seed=1, device="cpu", **built(run))
    for parameter in model.policy.parameters():
        parameter.data.normal_(0.0, 0.3)
    return model, frozen(model, run)


@pytest.mark.parametrize(("observation", "algorithm"), [*((kind, "ppo") for kind in KINDS), ("positions", "recurrent")])
def test_it_acts_as_the_model_it_was_made_of(observation, algorithm):
    model, policy = untrained(observation, algorithm, force_limit=20.0)
    kind = KINDS[observation]
    learner = agent_view(gymnasium.make("SMOPendulum-v0", force_limit=20.0), observation)
    plant = gymnasium.make("SMOPendulum-v0", force_limit=20.0)
    plant = ObserverWrapper(plant, **kind.observer) if kind.observer else plant
    seen, _ = learner.reset(seed=2)
    told, _ = plant.reset(seed=2)
    forces, states, start = [], [None, None], np.array([True])
    for _ in range(30):
        action, states[0] = model.predict(seen, states[0], start, deterministic=True)
        force, states[1] = policy.predict(told, states[1], start)
        assert force == pytest.approx(20.0 * action, abs=2e-3)
        forces.append(force[0])
        seen, *_ = learner.step(action)
        told, *_ = plant.step(20.0 * action.astype(np.float64))
        start = np.array([False])
    assert np.ptp(forces) > 0.1


@pytest.mark.parametrize(("observation", "algorithm"), [("stacked", "ppo"), ("positions", "recurrent")])
def test_memory_begins_anew_where_an_episode_does(observation, algorithm):
    _, policy = untrained(observation, algorithm)
    rng = np.random.default_rng(0)
    state, told = None, rng.normal(size=(5, 3, 2))
    for observation_ in told[:-1]:
        _, state = policy.predict(observation_, state, np.zeros(3, dtype=bool))
    kept, _ = policy.predict(told[-1], state, np.zeros(3, dtype=bool))
    mixed, _ = policy.predict(told[-1], state, np.array([False, True, False]))
    fresh, _ = policy.predict(told[-1])
    assert np.allclose(mixed[[0, 2]], kept[[0, 2]], atol=1e-12)
    assert np.allclose(mixed[1], fresh[1], atol=1e-12)
    assert not np.allclose(kept[1], fresh[1])
    alone, _ = policy.predict(told[-1, 1])
    assert alone.shape == (1,)
    assert alone == pytest.approx(fresh[1], abs=1e-12)


def test_forces_are_clipped_and_finite():
    card = Card(environment="e", observation="positions", units=(1, 1), frames=1, layers=(2, 1), force_limit=5.0)
    policy = MlpPolicy(card, [(np.array([[2.0, 0.0]]), np.array([0.0]))])
    forces, _ = policy.predict(np.array([[1.0, 0.0], [-9.0, 0.0], [0.25, np.nan]]))
    assert forces.tolist() == [[5.0], [-5.0], [2.5]]


def test_positions_alone_do_not_look_at_an_estimate():
    _, policy = untrained("positions")
    told = np.random.default_rng(0).normal(size=(4, 6))
    assert np.array_equal(policy.predict(told)[0], policy.predict(told[:, :2])[0])
    with pytest.raises(ValueError, match=r"shape \(4, 3\).*'positions', 2 or 6 entries"):
        policy.predict(told[:, :3])
    _, policy = untrained("smo")
    with pytest.raises(ValueError, match=r"'smo', 6 entries"):
        policy.predict(told[:, :2])


@pytest.mark.parametrize(("observation", "algorithm"), [("stacked", "ppo"), ("positions", "recurrent")])
def test_files_keep_everything(observation, algorithm, tmp_path):
    _, policy = untrained(observation, algorithm)
    policy.save(tmp_path / "a.safetensors")
    again = MlpPolicy.load(tmp_path / "a.safetensors")
    assert type(again) is type(policy)
    assert again.card == policy.card
    told = np.random.default_rng(0).normal(size=(4, 2))
    assert np.array_equal(again.predict(told)[0], policy.predict(told)[0])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "a.safetensors"]


def test_bad_files_are_named(tmp_path):
    path = tmp_path / "a.safetensors"
    with pytest.raises(ValueError, match=r"a\.safetensors: cannot be read"):
        MlpPolicy.load(path)
    _, policy = untrained()
    policy.save(path)
    weights, card = path.read_bytes(), json.loads(path.with_suffix(".json").read_text())
    path.unlink()
    with pytest.raises(ValueError, match=r"a\.safetensors: cannot be read"):
        MlpPolicy.load(path)
    for damaged in (weights[:-9], b"", b"PK\x03\x04" + weights):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=r"a\.safetensors: is corrupt"):
            MlpPolicy.load(path)
    path.write_bytes(weights)
    for change, message in [
        ({"layers": [6, 16, 9, 1]}, r"a\.safetensors: weights have shapes .* asks for"),
        ({"layers": [6, 8, 1]}, r"a\.safetensors: holds .* asks for"),
        ({"units": [1.0, 1.0]}, r"a\.safetensors: units=.* do not fit 'smo' of SMOPendulum-v0"),
        ({"observation": "positions"}, r"a\.safetensors: units=.* do not fit 'positions' of SMOPendulum-v0"),
        ({"units": [1.0] * 10}, r"a\.safetensors: units=.* do not fit 'smo'"),
        (
            {"units": [1.0] * 10, "environment": "SMOPendulumTracking-v0"},
            r"a\.safetensors: layers=.* must lead from 10 inputs",
        ),
        ({"observation": "stacked", "units": [1.0] * 6}, r"a\.safetensors: frames=1 must be 4, of 'stacked'"),
        ({"control_period": 0.0}, r"a\.json: is no card of a policy \(control_period: "),
        ({"control_period": None}, r"a\.json: is no card of a policy \(control_period: "),
        ({"configuration": {"options": None}}, r"a\.json: is no card .*its options must be mappings"),
        ({"configuration": None}, r"a\.json: is no card .*its options must be mappings"),
        ({"observation": "smoo"}, r"did you mean 'smo'"),
        ({"frames": 0}, r"a\.json: is no card of a policy \(frames: "),
        ({"lstm": 3}, r"a\.safetensors: holds .* asks for"),
    ]:
        path.with_suffix(".json").write_text(json.dumps(card | change))
        with pytest.raises(ValueError, match=message):
            MlpPolicy.load(path)
    path.with_suffix(".json").write_text("{")
    with pytest.raises(ValueError, match=r"a\.json: is no card of a policy"):
        MlpPolicy.load(path)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("lstm.weight_hh", np.full((48, 12), np.nan), "weights must be finite"),
        ("0.bias", np.full(8, np.inf), "weights must be finite"),
        ("0.bias", np.zeros(8, dtype=np.int64), "holds weights of type int64, they must be floating point"),
        ("0.bias", np.zeros(8, dtype=bool), "holds weights of type bool"),
        ("0.bias", torch.zeros(8, dtype=torch.bfloat16), "that NumPy can hold .*BF16"),
        ("0.bias", torch.zeros(8, dtype=torch.float8_e4m3fn), "that NumPy can hold .*F8_E4M3"),
    ],
)
def test_weights_are_finite_numbers_of_floating_point(name, value, message, tmp_path):
    path = tmp_path / "a.safetensors"
    untrained("positions", "recurrent")[1].save(path)
    tensors = {key: torch.from_numpy(tensor) for key, tensor in load_file(path).items()}
    tensors[name] = torch.as_tensor(value)
    path.write_bytes(tensor_bytes(tensors))
    with pytest.raises(ValueError, match=r"a\.safetensors: .*" + message):
        MlpPolicy.load(path)


def test_the_control_period_is_that_of_training(tmp_path):
    path = tmp_path / "a.safetensors"
    _, policy = untrained(control_period=0.01)
    policy.save(path)
    card = json.loads(path.with_suffix(".json").read_text())
    assert card.pop("control_period") == 0.01
    path.with_suffix(".json").write_text(json.dumps(card))  # as the first cards were
    assert MlpPolicy.load(path).control_period == 0.01
    del card["configuration"]
    path.with_suffix(".json").write_text(json.dumps(card))
    assert MlpPolicy.load(path).control_period == 0.02


def test_nothing_of_torch_is_needed():
    code = "import sys, smo_gym.policies as p; p.shipped('SMOPendulum-v0'); assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)


@pytest.mark.parametrize("kind", ["smo", "stacked", "lstm"])
def test_an_action_has_the_same_bits_in_every_batch(kind):
    """A matrix product of BLAS sums in an order that depends on the number of rows; these sums do not."""
    rng = np.random.default_rng(0)
    observation = "smo" if kind == "smo" else "positions" if kind == "lstm" else "stacked"
    frames, size = (4, 2) if kind == "stacked" else (1, 6 if kind == "smo" else 2)
    width = 64 if kind == "lstm" else frames * size
    card = Card(
        environment="SMOPendulum-v0",
        observation=observation,
        units=tuple(UNITS[:2] * (size // 2) if size == 2 else (*UNITS[:2], *UNITS)),
        frames=frames,
        layers=(width, 64, 64, 1),
        lstm=64 if kind == "lstm" else None,
        force_limit=30.0,
    )
    layers = [(rng.normal(size=(k, m)) / 8, rng.normal(size=k)) for m, k in ((width, 64), (64, 64), (64, 1))]
    lstm = tuple(rng.normal(size=s) / 8 for s in ((256, size), (256, 64), (256,), (256,)))
    policy = LstmPolicy(card, layers, lstm) if kind == "lstm" else MlpPolicy(card, layers)
    runs = {n: [] for n in (1, 2, 3, 7, 300)}
    observations = rng.normal(size=(3, 300, size))
    for n, found in runs.items():
        state = None
        for seen in observations:
            action, state = policy.predict(seen[:n], state)
            found.append(action)
    for n in (1, 2, 3, 7):
        assert all(np.array_equal(a, b[:n]) for a, b in zip(runs[n], runs[300], strict=True))
    alone, _ = policy.predict(observations[0, 5])
    assert np.array_equal(alone, runs[300][0][5])


@pytest.mark.parametrize("shape", [(1, 1), (1, 64), (3, 5), (4, 4), (9, 6), (64, 64)])
def test_sums_of_any_shape_are_right_and_the_same_in_every_batch(shape):
    """Few slots and many are summed in different loops."""
    rng = np.random.default_rng(0)
    W, x, b = rng.normal(size=shape), rng.normal(size=(shape[1], 131)), rng.normal(size=shape[0])
    together = affine(W, x, b)
    np.testing.assert_allclose(together, W @ x + b[:, None], atol=1e-13)
    for n in (1, 2, 3, 64, 65, 130):
        assert np.array_equal(affine(W, x[:, :n], b), together[:, :n])
        assert np.array_equal(affine(W, x[:, -n:], b), together[:, -n:])
    assert affine(W, x[:, :0], b).shape == (shape[0], 0)


def test_the_shipped_policy_acts_alone_as_among_thousands():
    policy = shipped("SMOPendulum-v0")
    observations = np.random.default_rng(0).normal(size=(5000, 6))
    together, _ = policy.predict(observations)
    assert np.array_equal(together, np.stack([policy.predict(observation)[0] for observation in observations]))


def test_a_policy_that_lacks_its_observer_says_what_to_do():
    policy = shipped("SMOPendulum-v0")
    wrapped = r"smo_gym\.ObserverWrapper\(env, observer='smo', .*, compensation=True\), .*VectorObserverWrapper"
    with pytest.raises(ValueError, match=f"wrap it in {wrapped}"):
        policy.predict(np.zeros(2))
    with pytest.raises(ValueError, match=r"has shape \(4, 10\).*'smo', 6 entries$"):
        policy.predict(np.zeros((4, 10)))
    for wrong in ("abc", None, [None] * 6, ["1"] * 6, [1j] * 6, [10**400] * 6, [True] * 6, [[0.0] * 6, [0.0]]):
        with pytest.raises(ValueError, match="observation=.* must be an array of numbers"):
            policy.predict(wrong)
    assert policy.predict(np.zeros((0, 6)))[0].shape == (0, 1)
    assert np.array_equal(policy.predict([0.0] * 6)[0], policy.predict(np.zeros(6))[0])


@pytest.mark.parametrize(("observation", "algorithm"), [("stacked", "ppo"), ("positions", "recurrent")])
def test_a_state_of_other_observations_is_refused(observation, algorithm):
    """One of five slots would broadcast to one observation, silently."""
    _, policy = untrained(observation, algorithm)
    state = policy.predict(np.zeros((5, 2)))[1]
    for wrong in (state, "abc", (), state + state, tuple(part[:1, :1] for part in state)):
        for seen in (np.zeros(2), np.zeros((3, 2))):
            with pytest.raises(ValueError, match=r"state has shapes .*, it must have .* or None at the start"):
                policy.predict(seen, wrong)
    for start in (np.ones(4, dtype=bool), np.ones((5, 1), dtype=bool)):
        with pytest.raises(ValueError, match=r"episode_start has shape .*, it must be one flag or have shape \(5,\)"):
            policy.predict(np.zeros((5, 2)), state, start)
    policy.predict(np.zeros((5, 2)), state, True)
