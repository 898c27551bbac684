"""What the site takes from the code: commands, settings, environments, modules. ``<!-- generated: NAME ... -->``."""

import contextlib
import inspect
import io
import math
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import gymnasium
import yaml
from tabulate import tabulate

import smo_gym
from smo_gym.cli.commands import COMMANDS, main
from smo_gym.envs.task import HANGING, Task

ROOT = Path(__file__).resolve().parents[2]
_MARK = re.compile(r"<!-- generated: (\w+) ?(.*?) -->")
_WIDTH = "60"


def on_page_markdown(markdown: str, **kwargs: Any) -> str:
    """Put what is generated into a page."""
    return _MARK.sub(lambda mark: GENERATORS[mark[1]](*mark[2].split()), markdown)


def commands() -> str:
    """The help of every command."""
    return "\n\n".join(
        f"## smo-gym {name}\n\n{output(name, '--help').replace('.terminal', '.terminal .help', 1)}"
        for name in sorted(COMMANDS)
    )


def output(name: str, *arguments: str) -> str:
    """What a command prints."""
    before, shown = os.environ.get("COLUMNS"), io.StringIO()
    try:
        os.environ["COLUMNS"] = _WIDTH
        with contextlib.redirect_stdout(shown):
            main([name, *arguments])
    finally:
        os.environ.pop("COLUMNS") if before is None else os.environ.update(COLUMNS=before)
    return f"```{{.text .terminal}}\n{shown.getvalue()}```"


def modules(package: str) -> str:
    """The reference of every module of a package."""
    folder = ROOT.joinpath(*package.split("."))
    return "\n\n".join(f"::: {package}.{path.stem}" for path in sorted(folder.glob("[!_]*.py")))


def readme(*words: str) -> str:
    """The table in a section of the README."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    section = text.partition(f"\n## {' '.join(words)}\n")[2].partition("\n## ")[0]
    table = re.search(r"(?:^\|.*\n)+", section, re.MULTILINE)
    if table is None:
        raise ValueError(f"README.md has no table under {' '.join(words)!r}")
    return table[0]


def contributing() -> str:
    """What stands in the repository for those who contribute, its links as they are from here."""
    return (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").replace("](docs/", "](")


def settings() -> str:
    """Every setting of ``configs/`` that has a source, file by file."""
    parts = []
    for path in sorted(ROOT.glob("configs/*.yaml")):
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        rows = [
            (f"`{'.'.join(place)}`", f"`{setting['value']}`", setting["source"], setting.get("note", ""))
            for place, setting in _settings(data, ())
        ]
        if rows:
            table = tabulate(rows, ("setting", "value", "source", "note"), "github", disable_numparse=True)
            base = f"\n\nExtends `{data['extends']}`: what is not here stands there." if "extends" in data else ""
            parts.append(f"### configs/{path.name}{base}\n\n{table}")
    return "\n\n".join(parts)


def _settings(data: Any, place: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], dict[str, Any]]]:
    if isinstance(data, dict) and {"value", "source"} <= data.keys():
        yield place, data
    elif isinstance(data, dict):
        for name, inner in data.items():
            yield from _settings(inner, (*place, str(name)))


def environment(name: str) -> str:
    """A page in Gymnasium's form, from the environment that the name makes and its docstring."""
    env = gymnasium.make(name)
    cls = type(env.unwrapped)
    base = smo_gym.envs.pendulum.PendulumEnv
    facts = [
        ("Action space", f"`{env.action_space}`"),
        ("Observation space", f"`{env.observation_space}`"),
        ("Control periods in an episode", env.unwrapped.task.steps),
        ("Import", f'`import smo_gym; gymnasium.make("{name}")`'),
    ]
    parts = [tabulate(facts, ("", ""), "github", disable_numparse=True)]
    if cls is not base:
        parts += [
            _text(cls),
            _differences(env.unwrapped.task),
            "What follows holds for all three environments, but for what differs above.",
        ]
    parts += [_text(base), f"## Version History\n\n- `{name}`: the first version, since smo_gym 0.1.0"]
    return "\n\n".join(parts).replace("## Rewards\n", f"## Rewards\n\n{_reward()}\n", 1)


def _reward() -> str:
    """The reward as the mathematics has it."""
    section = (ROOT / "docs/mathematics.md").read_text(encoding="utf-8").partition("\n## Reward\n")[2]
    return re.search(r"^\$\$ .* \$\$$", section, re.MULTILINE)[0]  # type: ignore[index]


def _text(cls: type) -> str:
    """A class docstring as Markdown, without the section of errors; the API reference has that."""
    text = (inspect.getdoc(cls) or "").partition("\nRaises:")[0]

    def link(role: re.Match[str]) -> str:
        name = role[1] if role[1].startswith("smo_gym.") else f"{cls.__module__}.{role[1]}"
        return f"[`{name.rpartition('.')[2]}`][{name}]"

    names = re.sub(r":(?:class|func):`~?([\w.]+)`", link, text)
    return names.replace("``", "`").strip()


def _differences(task: Task) -> str:
    """The defaults that are not those of SMOPendulum-v0."""
    usual, here = _options(HANGING), _options(task)
    rows = [(f"`{name}`", _shown(usual[name]), _shown(here[name])) for name in here if here[name] != usual[name]]
    return "## Defaults that differ\n\n" + tabulate(
        rows, ("argument", "SMOPendulum-v0", "here"), "github", disable_numparse=True
    )


def _options(task: Task) -> dict[str, Any]:
    options = {f.name: getattr(task, f.name) for f in fields(Task) if f.name != "params"}
    return options | {f"params {name}": value for name, value in task.params.as_dict().items()}


def _shown(value: Any) -> str:
    if value is None or value == math.inf:
        return "None"
    if isinstance(value, smo_gym.Reference):
        return f"the shipped reference: {value.horizon:g} s from {list(value.x0)} to {list(value.xT)}"
    return f"`{value:.5g}`" if isinstance(value, float) else f"`{value}`"


GENERATORS: dict[str, Callable[..., str]] = {
    "commands": commands,
    "contributing": contributing,
    "environment": environment,
    "modules": modules,
    "output": output,
    "readme": readme,
    "settings": settings,
}
