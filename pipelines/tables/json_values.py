"""Values of the types of JSON."""

import math
from dataclasses import fields, is_dataclass
from typing import Any


def json_value(value: Any) -> Any:
    """A value with the types of JSON; numbers that are not finite become null, a dataclass an object."""
    if not isinstance(value, type) and is_dataclass(value):
        return {field.name: json_value(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, dict):
        return {str(key): json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(item) for item in value]
    if hasattr(value, "item") and not isinstance(value, str):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    return str(value)
