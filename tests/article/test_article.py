"""The published data and the printed constants."""

import numpy as np
import pytest

from smo_gym import CartPendulum, article
from smo_gym.article import consistency
from smo_gym.evaluation import scenario


def cells(**where):
    return {
        cell: value
        for cell, value in article.published().items()
        if all(getattr(cell, name) == wanted for name, wanted in where.items())
    }


def test_all_printed_cells_are_there():
    assert len(article.published()) == 176
    assert len(cells(metric="mse")) == 104
    assert len(cells(table="5")) == 32


def test_every_printed_rms_is_the_root_of_its_mse():
    from dataclasses import replace

    for cell, rms in cells(metric="rms").items():
        mse = article.published()[replace(cell, metric="mse")]
        assert abs(rms - np.sqrt(mse)) < 1e-4


def test_averages_and_reductions_of_table_4_follow_from_its_cells():
    printed = {
        "lqr": ((0.121, 0.044882, 62.91), (0.04563, 0.031057, 31.94)),
        "smc": ((0.166883, 0.091493, 45.18), (0.018158, 0.012045, 33.67)),
    }
    for controller, states in printed.items():
        for state, (without, with_, reduction) in zip(("h", "theta"), states, strict=True):
            mean = {
                arm: np.mean(
                    list(cells(table="4", controller=controller, metric="mse", state=state, compensation=arm).values())
                )
                for arm in ("without", "with")
            }
            assert abs(mean["without"] - without) < 6e-5
            assert abs(mean["with"] - with_) < 6e-6
            assert abs(100 * (1 - mean["with"] / mean["without"]) - reduction) < 0.02


def test_what_the_article_says_of_its_own_cells():
    found = consistency.checks()
    assert len(found) == 72 + 64 + 2
    disagreeing = [check for check in found if check.agrees != "yes"]
    averages_of_table_5 = [check for check in disagreeing if check.table == "5"]
    assert {(check.row, check.quantity, check.agrees) for check in averages_of_table_5} == {
        ("average", "mse reduction", "as the mean of reductions")
    }
    assert len(averages_of_table_5) == 4
    (claim,) = (check for check in disagreeing if check.table != "5")
    assert (claim.table, claim.state, claim.printed, claim.agrees) == ("abstract", "theta", 29.0, "no")
    assert claim.recomputed == pytest.approx(18.55, abs=0.01)


def test_table_2_is_the_default_plant():
    assert CartPendulum().as_dict() == {"cart_mass": 3.5, "bob_mass": 0.32, "rod_length": 0.44, "gravity": -9.8}


def test_the_scenarios_have_the_printed_levels_cases_and_gains():
    for name, table in (("regulation", "4"), ("initial-conditions", "5")):
        chosen = scenario.named(name)
        assert {f"{100 * x:g}" for x in chosen.uncertainty.value} >= {
            c.uncertainty_percent for c in cells(table=table)
        } - {""}
        assert set(chosen.initial_states.value) == {c.case for c in cells(table=table)}
        smc = chosen.controllers["smc"]
        assert {key: getattr(smc, key).value for key in ("Z0", "lam", "epsilon")} == article.SMC_GAINS
        assert [settings.observer.gains.value for settings in chosen.controllers.values()] == ["lqr", "smc"]
