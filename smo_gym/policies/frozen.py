"""A trained policy frozen to arrays: a small forward pass in NumPy, stored without pickle, run without torch."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from safetensors import SafetensorError
from safetensors.numpy import load as read_tensors
from safetensors.numpy import save as tensor_bytes

from .. import files
from ..envs.task import HANGING
from ..typing import Array, Flags
from ..validation import choice, observed
from ..wrappers.view import KINDS, scaled
from .forward import affine, dense, lstm
from .memory import recalled, stacked, starts

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


class Card(BaseModel):
    """What a policy is, beside its weights.

    The first part is what it computes with; the second says where it comes from.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    environment: str
    observation: str
    """One of :data:`~smo_gym.wrappers.view.KINDS`."""
    units: tuple[Positive, ...]
    """What each of one frame's entries is divided by."""
    frames: int = Field(ge=1)
    layers: tuple[Annotated[int, Field(ge=1)], ...] = Field(min_length=2)
    """Widths of the layers, inputs first; tanh between them."""
    lstm: Annotated[int, Field(ge=1)] | None = None
    """Width of an LSTM in front of the layers."""
    force_limit: Positive
    """Force in N that an action of 1 stands for."""
    control_period: Positive = HANGING.control_period
    """Control period of its training in s. A card without it has that of the environment's options."""

    command: str = ""
    seed: int | None = None
    versions: dict[str, str] = {}
    configuration: dict[str, Any] = {}
    """The environment's options and the algorithm's hyperparameters."""
    curve: list[dict[str, float]] = []
    """Evaluations during training, on plants that training did not see."""
    measured: dict[str, float] = {}
    """What this policy, the best of the curve, gave on plants that neither training nor those evaluations saw."""

    @model_validator(mode="before")
    @classmethod
    def _period(cls, data: Any) -> Any:
        configuration = data.get("configuration", {}) if isinstance(data, Mapping) else None
        options = configuration.get("options", {}) if isinstance(configuration, Mapping) else None
        if not isinstance(options, Mapping):
            raise ValueError("configuration and its options must be mappings")
        return {"control_period": options.get("control_period", HANGING.control_period), **data}

    @property
    def follows(self) -> bool:
        """Whether its environment has a reference, which observations then tell."""
        told = self.configuration.get("options", {}).get("reference")
        return told is not None or self.environment == "SMOPendulumTracking-v0"


@dataclass(frozen=True)
class MlpPolicy:
    """u = force_limit clip(W_n tanh(... tanh(W_1 o + b_1) ...) + b_n, -1, 1), o the scaled observation.

    Weights are (out, in), biases (out,). A policy of positions alone also takes observations that an estimate follows,
    and does not look at it.

    Raises:
        ValueError: an unknown kind of observation, a card that contradicts it, or weights that do not fit the card.
    """

    card: Card
    layers: Sequence[tuple[Array, Array]]

    def __post_init__(self) -> None:
        card = self.card
        kind = KINDS[choice("observation", card.observation, KINDS)]
        if card.frames != kind.frames:
            raise ValueError(f"frames={card.frames} must be {kind.frames}, of {card.observation!r}")
        states, rest = divmod(len(card.units) - 2, 4)  # beside the positions
        least = int(bool(kind.observer))
        if rest or states < least or (states > least and not card.follows):
            raise ValueError(f"units={card.units} do not fit {card.observation!r} of {card.environment}")
        wanted = list(zip(card.layers[1:], card.layers[:-1], strict=True))
        shapes = [(W.shape, b.shape) for W, b in self.layers]
        if shapes != [(shape, shape[:1]) for shape in wanted]:
            raise ValueError(f"weights have shapes {[W for W, _ in shapes]}, the card asks for {wanted}")
        told = card.lstm or card.frames * len(card.units)
        if card.layers[0] != told or card.layers[-1] != 1:
            raise ValueError(f"layers={card.layers} must lead from {told} inputs to one force")
        if not all(np.isfinite(W).all() and np.isfinite(b).all() for W, b in self.layers):
            raise ValueError("weights must be finite")

    @property
    def control_period(self) -> float:
        """The control period of its training in s."""
        return self.card.control_period

    def predict(
        self,
        observation: Array,
        state: tuple[Array, ...] | None = None,
        episode_start: Flags | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """The force in N, shape (n, 1) for observations (n, observation) and (1,) for one.

        Where the policy sees several frames, ``state`` carries them, (n, frames, entries); they begin anew where
        ``episode_start`` is true, and everywhere without a state. The policy is always deterministic.

        Raises:
            ValueError: the observation is of another environment or lacks its observer, or state or starts are of other
                observations.
        """
        frame = scaled(self._seen(observation), np.array(self.card.units))
        seen, state = self._remember(np.atleast_2d(frame), state, episode_start)
        inputs = seen.T
        for W, b in self.layers[:-1]:
            inputs = dense(W, inputs, b)
        W, b = self.layers[-1]
        u = self.card.force_limit * np.clip(affine(W, inputs, b), -1.0, 1.0).T
        return (u if frame.ndim == 2 else u[0]), state

    def _remember(
        self, frame: Array, state: tuple[Array, ...] | None, episode_start: Flags | None
    ) -> tuple[Array, tuple[Array, ...] | None]:
        """Inputs of the first layer from the newest frame (n, entries) and what came before."""
        if self.card.frames == 1:
            return frame, state
        known = recalled(state, (len(frame), self.card.frames, frame.shape[1]))
        frames = stacked(frame, self.card.frames, known[0] if known else None, episode_start)
        return frames.reshape(len(frame), -1), (frames,)

    def _seen(self, given: Any) -> Array:
        observation = observed(given)
        size, observer = len(self.card.units), KINDS[self.card.observation].observer
        allowed = (size,) if observer else (size, size + 4)
        if observation.shape[-1] not in allowed:
            bare = observer and observation.shape[-1] == size - 4
            raise ValueError(
                f"observation has shape {observation.shape}: this policy of {self.card.environment} sees "
                f"{self.card.observation!r}, {' or '.join(map(str, allowed))} entries{self._way_out if bare else ''}"
            )
        return observation[..., :size]

    @property
    def _way_out(self) -> str:
        """How an environment that tells positions alone tells the estimate too."""
        observer = KINDS[self.card.observation].observer or {}
        settings = "".join(f", {name}={value!r}" for name, value in observer.items())
        return f": wrap it in smo_gym.ObserverWrapper(env{settings}), a batch in smo_gym.VectorObserverWrapper"

    def save(self, path: Path) -> None:
        """Write ``path`` (.safetensors) and the card beside it (.json), which belong together, the weights last."""
        tensors: dict[str, Array] = {}
        for k, (W, b) in enumerate(self.layers):
            tensors |= {f"{k}.weight": np.ascontiguousarray(W), f"{k}.bias": np.ascontiguousarray(b)}
        tensors |= self._memory()
        card = json.dumps(self.card.model_dump(mode="json"), indent=1) + "\n"
        files.write_set(path.parent, {path.with_suffix(".json").name: card, path.name: tensor_bytes(tensors)})

    def _memory(self) -> dict[str, Array]:
        return {}

    @staticmethod
    def load(path: Path | str) -> MlpPolicy:
        """A policy from its weights (.safetensors) and the card of the same name (.json) beside them.

        Raises:
            ValueError: a file is missing, corrupt, or does not fit the other; it is named.
        """
        path = Path(path)
        beside, weights = path.with_suffix(".json"), _read(path)  # the file that was named is the first to be missed
        try:
            card = Card.model_validate_json(_read(beside))
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(map(str, first["loc"]))
            raise ValueError(
                f"{beside}: is no card of a policy ({place + ': ' if place else ''}{first['msg']})"
            ) from None
        try:
            tensors = read_tensors(weights)
        except (SafetensorError, KeyError) as error:  # KeyError: a type that NumPy lacks
            raise ValueError(f"{path}: is corrupt or no safetensors file that NumPy can hold ({error})") from None
        count = len(card.layers) - 1
        names = {f"{k}.{part}" for k in range(count) for part in ("weight", "bias")}
        names |= set(LSTM) if card.lstm else set()
        if tensors.keys() != names:
            raise ValueError(f"{path}: holds {sorted(tensors)}, the card asks for {sorted(names)}")
        if kinds := {str(tensor.dtype) for tensor in tensors.values() if tensor.dtype.kind != "f"}:
            raise ValueError(f"{path}: holds weights of type {', '.join(sorted(kinds))}, they must be floating point")
        tensors = {name: tensor.astype(np.float64) for name, tensor in tensors.items()}
        layers = [(tensors[f"{k}.weight"], tensors[f"{k}.bias"]) for k in range(count)]
        try:
            return LstmPolicy(card, layers, tuple(tensors[k] for k in LSTM)) if card.lstm else MlpPolicy(card, layers)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None


LSTM = ("lstm.weight_ih", "lstm.weight_hh", "lstm.bias_ih", "lstm.bias_hh")


@dataclass(frozen=True)
class LstmPolicy(MlpPolicy):
    """An :class:`MlpPolicy` behind an LSTM of width m, whose gates i, f, g, o stand below each other as torch has them.

    ::

        c <- sigma(f) c + sigma(i) tanh(g),   h <- sigma(o) tanh(c)

    ``state`` is (h, c), each (n, m).

    Args:
        lstm: weights of the inputs (4 m, inputs) and of h (4 m, m), and the bias of each (4 m,).
    """

    lstm: tuple[Array, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        m, inputs = self.card.lstm or 0, self.card.frames * len(self.card.units)
        wanted = [(4 * m, inputs), (4 * m, m), (4 * m,), (4 * m,)]
        if [part.shape for part in self.lstm] != wanted:
            raise ValueError(f"lstm has shapes {[part.shape for part in self.lstm]}, the card asks for {wanted}")
        if not all(np.isfinite(part).all() for part in self.lstm):
            raise ValueError("weights must be finite")

    def _remember(
        self, frame: Array, state: tuple[Array, ...] | None, episode_start: Flags | None
    ) -> tuple[Array, tuple[Array, ...] | None]:
        W, U, b, d = self.lstm
        shape = (len(frame), U.shape[1])
        h, c = recalled(state, shape, shape) or (np.zeros(shape),) * 2
        keep = ~starts(episode_start, len(frame))[:, None]
        gates = affine(U, (h * keep).T, affine(W, frame.T, b + d))
        h, c = (part.T for part in lstm(gates, (c * keep).T))
        return h, (h, c)

    def _memory(self) -> dict[str, Array]:
        return dict(zip(LSTM, self.lstm, strict=True))


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
