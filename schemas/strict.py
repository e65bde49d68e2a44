"""The bases of the parts of a file that is written by hand."""

from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, field_validator, model_serializer
from pydantic_core.core_schema import SerializerFunctionWrapHandler

from schemas.bounds import unquoted


def _of_numbers(kind: Any) -> bool:
    """Whether a kind of value is a number, or several or none; not where its text is read, as a time of day, "06:00"."""
    parts = get_args(kind)
    if get_origin(kind) is Annotated:
        return BeforeValidator not in map(type, parts[1:]) and _of_numbers(parts[0])
    return all(map(_of_numbers, parts)) if parts else kind in (int, float, type(None), ...)


def refuse_repeated(values: Iterable[object], where: str, remedy: str) -> None:
    """Refuse values that are there more than once; ``where`` begins the message, ``remedy`` ends it."""
    texts = [str(value) for value in values]
    twice = sorted({text for text in texts if texts.count(text) > 1})
    if twice:
        raise ValueError(f"{where}{', '.join(twice)} is there twice, each may be there once; {remedy}")


class Strict(BaseModel):
    """A part of a file in which an unknown key is an error, not something to skip."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @field_validator("*", mode="before")
    @classmethod
    def _unquoted(cls, value: Any, info: Any) -> Any:
        about = cls.model_fields[info.field_name]
        return unquoted(value, info) if _of_numbers(Annotated[about.annotation, *about.metadata, None]) else value


class Grown(Strict):
    """A part with keys that earlier versions did not have: at their defaults its document leaves them out.

    Runs, captures and stations of those versions keep their content, and with it their names.
    """

    later: ClassVar[frozenset[str]]

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        defaults = {name: type(self).model_fields[name].get_default(call_default_factory=True) for name in self.later}
        return {
            name: value
            for name, value in handler(self).items()
            if name not in defaults or getattr(self, name) != defaults[name]
        }


class OnlyStated(Strict):
    """A part whose document has the keys that are stated, and no other."""

    @model_serializer(mode="wrap")
    def _only_stated(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {name: value for name, value in handler(self).items() if name in self.model_fields_set}
