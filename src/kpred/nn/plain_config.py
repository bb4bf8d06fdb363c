"""One way to write a configuration as plain values, and to read and check it again."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from kpred.errors import ConfigError

Config = TypeVar("Config", bound="PlainConfig")


@dataclass(frozen=True)
class PlainConfig:
    """Base of settings that stand in config.json, in checkpoints and in records of training."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for config.json, checkpoints and records."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls: type[Config], values: dict[str, Any]) -> Config:
        """Return the config written by `to_dict`; settings that it lacks have their defaults.

        Raises:
            ConfigError: if a key is unknown, as when the file was written by a newer version, or a value cannot be.
        """
        unknown = set(values) - {field.name for field in dataclasses.fields(cls)}
        if unknown:
            raise ConfigError(f"Config has unknown settings {sorted(unknown)}; is it from a newer kpred?")
        types = get_type_hints(cls)
        return cls(**{name: _read_value(name, value, types[name]) for name, value in values.items()})


def _read_value(name: str, value: Any, kind: Any) -> Any:
    """Convert a plain value to the type of its setting: a number, word, flag, choice, tuple or group of settings."""
    if get_origin(kind) is Literal:
        if value not in get_args(kind):
            raise ConfigError(f"Setting {name} must be one of {', '.join(get_args(kind))}, but is {value!r}.")
        return value
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        fits = isinstance(value, list | tuple) and (others == [...] or len(value) == 1 + len(others))
        if not fits:
            raise ConfigError(f"Setting {name} must be a list of {first.__name__}, but is {value!r}.")
        return tuple(_read_value(name, one, first) for one in value)
    if issubclass(kind, PlainConfig) and isinstance(value, dict):
        return kind.from_dict(value)
    if type(value) is not kind and (kind, type(value)) != (float, int):
        raise ConfigError(f"Setting {name} must be of type {kind.__name__}, but is {value!r}.")
    return value
