"""The RL table: who is compared, what the intervals are over, what a failed run counts."""

import csv
import sys

import numpy as np
import pytest
import yaml

from smo_gym.cli import compare
from smo_gym.evaluation import scenario, study
from smo_gym.learning import bootstrap, contest, contest_table
from smo_gym.learning.contest import FAILED, Contender, Scores
from smo_gym.policies.frozen import Card, MlpPolicy

K = np.array([7.197, -4.026, 10.96, -0.9999])  # of configs/article.yaml


def policy(folder, seed, observation="smo", algorithm="ppo", push=0.0, environment="SMOPendulum-v0", **options):
    """LQR on estimates as a policy of one layer, or a constant push (in N) that knows nothing."""
    units = np.array([1.0, 1.0, 1.0, 1.0, 2.0, 4.0]) if observation == "smo" else np.ones(2)
    W = -np.array([[0.0, 0.0, *K * units[2:]]]) / 30.0 if observation == "smo" else np.zeros((1, 2))
    card = Card(
        environment=environment,
        observation=observation,
        units=tuple(units),
        frames=1,
        layers=(len(units), 1),
        force_limit=30.0,
        seed=seed,
        configuration={"algorithm": algorithm, "seed": seed, "steps": 7000, "options": options},
    )
    folder.mkdir(parents=True)
    MlpPolicy(card, [(W, np.array([push / 30.0]))]).save(folder / "policy.safetensors")


def scores(values, title="smo", learned=True):
    """Scores from numbers (policies, levels, plants), or (policies, plants) at one level."""
    values = np.asarray(values, dtype=float)
    values = values if values.ndim == 3 else values[:, None]
    cards = tuple(None for _ in values) if learned else ()
    return Scores(Contender("PPO", title, ("",) * len(values), cards), values, values == FAILED)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Coarse intervals."""
    monkeypatch.setattr(bootstrap, "REPETITIONS", 100)


@pytest.fixture
def short(tmp_path):
    """Table 4 in brief, on a track."""
    changes = {"horizon": 3.0, "uncertainty": [0.1, 0.2], "track_limit": 4.0}
    data = {name: {"value": value, "source": "chosen"} for name, value in changes.items()}
    path = tmp_path / "short.yaml"
    path.write_text(yaml.safe_dump({"extends": "regulation", **data}))
    return path


def test_the_table_is_made_of_runs_of_the_harness(tmp_path, short, capsys):
    for seed in (3, 1):
        policy(tmp_path / f"runs/a{seed}", seed, control_period=0.001)
        policy(tmp_path / f"runs/b{seed}", seed, "positions", push=10.0 * seed)
    policy(tmp_path / "runs/c", 0, "positions", "recurrent")
    policy(tmp_path / "runs/upright", 0, environment="SMOPendulumUpright-v0")
    out = tmp_path / "out"
    arguments = [str(tmp_path / "runs"), "--config", str(short), "--runs", "3", "--out", str(out)]
    assert compare.main(arguments) == 0
    printed = capsys.readouterr()
    assert "runs/upright/policy.safetensors is left out: it was trained for SMOPendulumUpright-v0" in printed.err
    with (out / "learning.csv").open(newline="") as file:
        rows = {(row["controller"], row["observation"], row["uncertainty"]): row for row in csv.DictReader(file)}
    assert {place[2]: row["row"] for place, row in rows.items()} == {"0.1": "level", "0.2": "level", "": "all"}
    with (out / "runs.csv").open(newline="") as file:
        runs = list(csv.DictReader(file))
    assert len(rows) == 3 * (3 + 6 + 6)
    # the policy is the LQR, so its runs are the LQR's, and the LQR's are those of agents/evaluate.py
    place = scenario.load(short).changed(force_limit=30.0)
    (group,) = (g for g in study.groups([place], ["lqr"], ["with"], 3) if g.uncertainty == 0.2)
    (outcome,) = study.measure([group], 0)
    wanted = outcome.metrics["mse_h"] + outcome.metrics["mse_theta"]
    for controller in ("PPO", "LQR"):
        place = (controller, "smo", "0.2")
        mine = [row for row in runs if (row["controller"], row["observation"], row["uncertainty"]) == place]
        assert [row["seed"] for row in mine] == (["1"] * 3 + ["3"] * 3 if controller == "PPO" else [""] * 3)
        assert [float(row["score"]) for row in mine[-3:]] == pytest.approx(wanted, rel=1e-6)
    failed = rows["PPO", "positions", ""]
    assert (failed["failures"], failed["runs"], float(failed["iqm"])) == ("12", "12", FAILED)
    assert rows["RecurrentPPO", "positions", ""]["ci_low"] == ""
    text = (out / "learning.md").read_text()
    for line in (
        "- PPO on smo against PPO on positions: open: a verdict needs five training seeds. Its interquartile mean is",
        "- PPO on smo against RecurrentPPO on positions: open: a verdict needs five training seeds.",
        "probability 1 [1, 1] (failed: 0 of 12 against 12 of 12).",
        "12 of 12",
        "7,000",
    ):
        assert line in text
        assert line in " ".join(printed.out.split())
    assert max(map(len, printed.out.splitlines()[:-1])) <= 100


def test_a_seed_is_one_draw_however_many_plants_it_meets():
    rng = np.random.default_rng(0)
    of_seeds = scores(np.arange(1.0, 6.0)[:, None] + 1e-3 * rng.normal(size=(5, 200)))
    of_plants = scores(np.tile(rng.uniform(1.0, 5.0, 200), (5, 1)))
    (level, overall), (narrow, _) = map(bootstrap.interquartile_means, (of_seeds, of_plants))
    assert level == overall
    assert level.value == pytest.approx(3.0, abs=0.01)  # of 1..5 the middle half: 2.25 of 2, 3, 4 each on either side
    assert level.high - level.low > 1.5
    assert narrow.high - narrow.low < 1.0
    assert narrow.value == pytest.approx(np.sort(of_plants.values, axis=None)[250:750].mean())


def test_pairs_share_their_plants():
    plants = np.random.default_rng(1).uniform(1.0, 5.0, (1, 30)).repeat(5, axis=0)
    comparison = bootstrap.compare(scores(0.99 * plants), scores(plants, "positions"))
    assert comparison.verdict == "yes"
    assert comparison.ratio.value == pytest.approx(0.99)
    assert (comparison.probability.low, comparison.probability.value, comparison.probability.high) == (1.0, 1.0, 1.0)
    assert bootstrap.compare(scores(plants), scores(0.99 * plants, "positions")).verdict == "no, it is worse"
    same = bootstrap.compare(scores(plants), scores(plants, "positions"))
    assert (same.verdict, same.probability.value) == ("undecided", 0.5)


def test_no_level_is_trimmed_away():
    plants = np.random.default_rng(1).uniform(1.0, 5.0, (5, 1, 30)).repeat(6, axis=1)
    better = 0.95 * plants
    better[:, -1] = 100.0 * plants[:, -1]
    *levels, overall = bootstrap.interquartile_means(scores(better))
    assert overall.value == pytest.approx(np.mean([level.value for level in levels]))
    comparison = bootstrap.compare(scores(better), scores(plants, "positions"))
    assert comparison.verdict == "no, it is worse"
    assert comparison.ratio.value == pytest.approx((5 * 0.95 + 100.0) / 6)


def test_a_verdict_says_who_fails_more_often():
    plants = np.random.default_rng(1).uniform(1.0, 5.0, (5, 30))
    fails = 0.5 * plants
    fails[:, :3] = FAILED
    comparison = bootstrap.compare(scores(fails), scores(plants, "positions"))
    assert comparison.verdict == "yes, of the runs that stand; it fails more often"
    assert contest_table.sentence(comparison).endswith("(failed: 15 of 150 against 0 of 150).")
    plants[:, :3] = FAILED
    comparison = bootstrap.compare(scores(fails), scores(plants, "positions"))
    assert comparison.verdict == "yes"
    assert contest_table.sentence(comparison).endswith("(failed: 15 of 150 against 15 of 150).")


def test_few_seeds_decide_nothing():
    plants = np.random.default_rng(1).uniform(1.0, 5.0, (5, 30))
    for a, b in ((4, 5), (5, 4), (2, 2)):
        comparison = bootstrap.compare(scores(0.5 * plants[:a]), scores(plants[:b], "positions"))
        assert comparison.verdict == "open: a verdict needs five training seeds"
        assert comparison.ratio.value == pytest.approx(0.5, abs=0.1)
    law = scores(plants[:1], learned=False)
    assert bootstrap.compare(scores(0.1 * plants), law).verdict == "yes"
    few = bootstrap.compare(scores(plants[:, :1]), scores(plants[:, :1], "positions"))
    assert few.verdict == "open: an interval needs at least two plants a level"


def test_failed_runs_are_the_worst_and_are_not_dropped():
    values = np.ones((4, 10))
    values[:, :2] = FAILED
    assert bootstrap.interquartile_means(scores(values))[0].value == 1.0
    values[:, :5] = FAILED
    assert bootstrap.interquartile_means(scores(values))[0].value == pytest.approx(0.5 * FAILED)
    half = bootstrap.compare(scores(values), scores(np.full((4, 10), 2.0), "positions"))
    assert half.probability.value == 0.5


def test_one_seed_has_no_interval():
    alone = scores(np.random.default_rng(0).uniform(size=(1, 20)))
    assert np.isnan(bootstrap.interquartile_means(alone)[0].low)
    law = scores(alone.values[:, 0], learned=False)
    assert bootstrap.interquartile_means(law)[0].low < bootstrap.interquartile_means(law)[0].high
    assert bootstrap.compare(alone, law).verdict.startswith("open")
    assert "times the other's, and" in contest_table.sentence(bootstrap.compare(alone, law))


def test_bad_folders_are_named_before_any_run(tmp_path, short, capsys):
    def error(*arguments):
        assert compare.main([*arguments, "--config", str(short), "--out", str(tmp_path / "out")]) == 2
        message = capsys.readouterr().err
        assert message.startswith("smo-gym compare: error: ")
        assert not (tmp_path / "out").exists()
        return message

    runs = tmp_path / "runs"
    assert "runs: holds no policy.safetensors" in error(str(runs))
    policy(runs / "upright", 0, environment="SMOPendulumUpright-v0")
    assert "no policy for SMOPendulum-v0" in error(str(runs))
    policy(runs / "a", 0)
    assert "--runs: '0' must be a whole number of at least 1\n" in error(str(runs), "--runs", "0")
    assert "--seed: '-1' must be a whole number of at least 0\n" in error(str(runs), "--seed", "-1")
    assert "--force-limit: '-1' must be a positive number of newtons" in error(str(runs), "--force-limit", "-1")
    policy(runs / "b", 0)
    assert "have the same seed, 0" in error(str(runs))
    policy(tmp_path / "other", 1, control_period=0.01)
    assert "differ in more than their seed: in options" in error(str(runs / "a"), str(tmp_path / "other"))
    policy(tmp_path / "odd", 1, "positions", "sac")
    assert "must say seed and configuration.algorithm" in error(str(tmp_path / "odd"))
    weights = runs / "a" / "policy.safetensors"
    weights.write_bytes(weights.read_bytes()[:-9])
    assert "policy.safetensors: is corrupt" in error(str(runs))


def test_an_interruption_writes_nothing(tmp_path, short, monkeypatch, capsys):
    policy(tmp_path / "runs/a", 0)

    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(contest, "measure", interrupt)
    arguments = [str(tmp_path / "runs"), "--config", str(short), "--out", str(tmp_path / "out")]
    assert compare.main(arguments) == 130
    assert "interrupted, nothing was written" in capsys.readouterr().err
    assert not list((tmp_path / "out").iterdir())


def test_a_missing_extra_is_named(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "arch.bootstrap", None)
    monkeypatch.delitem(sys.modules, "smo_gym.learning.bootstrap")
    monkeypatch.delattr("smo_gym.learning.bootstrap")
    assert compare.main([]) == 2
    assert 'pip install "smo_gym[rl]"' in capsys.readouterr().err


@pytest.mark.slow
def test_an_interval_from_five_seeds_covers_95_percent_and_a_plain_percentile_interval_does_not(monkeypatch):
    def coverage(runs=150):
        """How often the interval of a learned policy's ratio to a law holds the true one, 1."""
        rng, law, covered = np.random.default_rng(0), scores(np.ones((1, 1, 2)), learned=False), 0
        for _ in range(runs):
            learned = scores(np.exp(0.1 * rng.normal(size=(5, 1, 1))).repeat(2, axis=2))
            ratio = bootstrap.compare(learned, law).ratio
            covered += ratio.low <= 1.0 <= ratio.high
        return covered / runs

    assert 0.92 <= coverage() <= 0.98
    monkeypatch.setattr(bootstrap, "widening", lambda seeds: 1.0)
    assert coverage() <= 0.92
