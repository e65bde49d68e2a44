"""Diagnosis, choice of effects, new versions of the model, error of each version; whoever asks and shows is handed in.

The demonstration, the history of a model and the workbench use its parts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast, get_type_hints

from pipelines.diagnosis.documents import ComparisonDocument, DiagnosisDocument, JudgedVersion, VersionDocument
from pipelines.improvement.documents import ImproveDocument, ImprovementChoice, LadderRow
from schemas.errors import WrongUse, did_you_mean

if TYPE_CHECKING:
    import pandas as pd

    from pipelines.diagnosis.diagnose import Examination
    from pipelines.jobs.model_files import ModelFile, ModelStep, Version


@dataclass(frozen=True)
class ImprovedTables:
    """Dwells and temperatures of the run, and of the fresh run where it was measured."""

    dwells: pd.DataFrame
    history: pd.DataFrame | None
    fresh: pd.DataFrame | None
    fresh_history: pd.DataFrame | None


class Attendant:
    """Who sees an improvement and answers its questions: nobody here, a terminal or pages in a subclass."""

    def working(self, what: str) -> AbstractContextManager[Any]:
        """Shows what is computed, until it is done."""
        return nullcontext()

    def begins_again(self, added: list[str]) -> None:
        """Is told that the model with some more effects is diagnosed next."""

    def diagnosed(self, made: Examination, *, first: bool) -> None:
        """Sees a diagnosis: of the model that is judged, or of the last version."""

    def agrees(self, effect: str, others: list[str], target: Path) -> bool:
        """Whether an effect is added, which the data do not separate from others."""
        return not others

    def fresh_run(self) -> tuple[str, pd.DataFrame, pd.DataFrame | None] | None:
        """Name, dwells and temperatures of a fresh run that is there or is measured now; None without a fresh run."""
        return None


def with_effects(text: str, steps: Sequence[ModelStep], file: Path) -> tuple[str, ModelFile | None]:
    """The text of a model file with one version more per step, and its model; None where no step is given."""
    from pipelines.jobs.model_files import extended

    model = None
    for step in steps:
        text, model = extended(text, step, f"model {file.name}")
    return text, model


def errors_by_version(
    versions: Sequence[Version], tables: ImprovedTables, working: Callable[[], AbstractContextManager[Any]]
) -> list[VersionDocument]:
    """The errors of each version and the verdict on its change; ``working`` is entered while a version is fitted."""
    from pipelines.diagnosis.confirmation import evolution

    def compared(effects: list[str], before: list[str] | None) -> ComparisonDocument:
        with working():
            from pipelines.diagnosis.compare import compare  # loads the search for effects: after the first line

            return compare(tables.dwells, effects, tables.history, tables.fresh, tables.fresh_history, before)

    return evolution(versions, compared)


@dataclass(frozen=True)
class Improvement:
    """Diagnosis, choice, new versions of the model, error of each version, diagnosis of the last one.

    model : the file that is judged; None for a list of effects · target : the file to write
    used_history : file of temperatures against time; empty where there is none · by : author of the change
    fresh : the fresh run as it was given; empty: the attendant is asked for one
    """

    data: str
    tables: ImprovedTables
    model: Path | None
    target: Path
    used_history: str
    by: str
    fresh: str
    attendant: Attendant

    def run(self, judged: list[str] | None, named: list[str], *, yes: bool) -> ImproveDocument:
        """The document of the improvement; the model file is written last, after all checks."""
        from pipelines.diagnosis.compare import both_measured
        from pipelines.jobs.model_files import publish_model

        tables = self.tables
        if tables.fresh is not None:  # units of another run are refused before the diagnoses
            both_measured(tables.dwells, tables.history, tables.fresh, tables.fresh_history)
        before = self._diagnosis(judged, first=True)
        choices = self._choices(before, named, yes=yes)
        added = [choice["effect"] for choice in choices if choice["added"]]
        versions, text = self._versions(before, added, choices)
        after = before
        if added:
            self.attendant.begins_again(added)
            after = self._diagnosis(list(versions[-1].effects), first=False)
        tables, fresh = self._with_fresh(changed=bool(added))
        rows = self._rows(versions, after["error"]["floor_ug"], tables)
        if text:
            publish_model(self.target, text)
        return {
            "data": self.data,
            "file": str(self.target) if added or self.model else None,
            "diagnosis": before,
            "choices": choices,
            "added": added,
            "effects": list(versions[-1].effects),
            "after": after if added else None,
            "adequate": after["adequate"],
            "ladder": rows,
            "refuted": [name for row in rows if row["confirmed"] is False for name in row["added"]],
            "warnings": list(dict.fromkeys(text for row in rows for text in row["warnings"])),
            "fresh": fresh or None,
            "next": [],
        }

    def _with_fresh(self, *, changed: bool) -> tuple[ImprovedTables, str]:
        """The tables with those of a fresh run, and its name; a fresh run judges a changed model where it can be measured."""
        if self.fresh or not changed:
            return self.tables, self.fresh
        found = self.attendant.fresh_run()
        if found is None:
            return self.tables, ""
        name, again, temperatures = found
        return ImprovedTables(self.tables.dwells, self.tables.history, again, temperatures), name

    def _diagnosis(self, effects: list[str] | None, *, first: bool) -> DiagnosisDocument:
        with self.attendant.working("looking for missing effects"):
            from pipelines.diagnosis.diagnose import examination  # loads the search for effects: after the first line

            made = examination(self.tables.dwells, self.tables.history, effects)
        made.document["history"] = self.used_history or None
        self.attendant.diagnosed(made, first=first)
        return made.document

    def _choices(self, diagnosis: DiagnosisDocument, named: list[str], *, yes: bool) -> list[ImprovementChoice]:
        """For each class with a recommended effect: the effect, those that these data do not separate from it, and the answer.

        Raises
        ------
        WrongUse
            An effect of --effect is in no class, two are in one class, or standard input ended before an answer.
        """
        classes = [g["effects"] for g in diagnosis["classes"] if set(g["effects"]) & set(diagnosis["recommended"])]
        suspected = (diagnosis["suspected"] or {"effects": []})["effects"]
        if set(named) & set(suspected):
            classes = [suspected]  # where one is suspected, none is recommended
        known = [name for members in classes for name in members]
        for name in named:
            if not known:
                raise WrongUse(f"improve: --effect {name}: the diagnosis names no effect; leave --effect out")
            if name not in known:
                raise WrongUse(
                    f"improve: --effect {name}: the diagnosis does not name it; {did_you_mean(name, known)}; 'tumbleline "
                    "extend' adds any effect"
                )
        answers: list[ImprovementChoice] = []
        for members in classes:
            chosen = [name for name in named if name in members]
            if len(chosen) > 1:
                raise WrongUse(
                    f"improve: --effect {','.join(chosen)}: these data cannot separate them, one per class is needed; name one"
                )
            effect = next(name for name in (*chosen, *diagnosis["recommended"]) if name in members)
            others = [name for name in members if name != effect]
            decided, added = self._answer(effect, others, chosen=bool(chosen), named=bool(named), yes=yes)
            answers.append({"effect": effect, "not_separated_from": others, "decided_by": decided, "added": added})
        return answers

    def _answer(
        self, effect: str, others: list[str], *, chosen: bool, named: bool, yes: bool
    ) -> tuple[Literal["question", "--effect", "--yes", "undecided"], bool]:
        """How it was decided on an effect (an option, a question, or not at all), and whether it is added."""
        if named:
            return "--effect", chosen
        if yes:
            return ("undecided", False) if others else ("--yes", True)
        return "question", self.attendant.agrees(effect, others, self.target)

    def _versions(
        self, diagnosis: DiagnosisDocument, added: list[str], choices: list[ImprovementChoice]
    ) -> tuple[list[Version], str]:
        """The model that was judged and one version per added effect; the text of the model file, empty without a change."""
        from pipelines.jobs.model_files import Version, model_step, model_text, versions

        effects, found = diagnosis["effects"], "suspects" if diagnosis["suspected"] else "names"
        judged = Version(1, tuple(effects), (), (), None)
        if not added:
            return [judged], ""
        others = {choice["effect"]: choice["not_separated_from"] for choice in choices}
        steps = [model_step(name, self._reason(others[name], found), self.by, self.data) for name in added]
        text = model_text(self.model) if self.model else self._begun(effects, steps[0])
        text, model = with_effects(text, steps, self.target)
        return (versions(model)[-len(added) - 1 :] if model else [judged]), text

    def _begun(self, effects: list[str], step: ModelStep) -> str:
        from inertial import effects as catalogue
        from inertial.effects.formula import Formula
        from pipelines.jobs.model_files import new_model

        formulas = [name for name in effects if isinstance(catalogue.get(name), Formula)]
        if formulas:
            raise WrongUse(
                f"improve: {formulas[0]} is a formula of the model file that run {self.data} was fitted with, a new file would "
                "be without it; give that file with --model FILE"
            )
        return new_model(self.target, effects, step.by, step.at)

    def _reason(self, others: list[str], found: str) -> str:
        alone = f"; these data do not separate it from {', '.join(others)}" if others else ""
        return f"a diagnosis of {Path(self.data).name} {found} it{alone}"

    def _rows(self, versions: list[Version], noise: float | None, given: ImprovedTables) -> list[LadderRow]:
        """Errors of each version; none where no unit can be judged."""
        if noise is None:
            return []
        rows = errors_by_version(versions, given, lambda: self.attendant.working("fitting"))
        names = get_type_hints(JudgedVersion)
        return [
            cast("LadderRow", {name: value for name, value in row.items() if name in names} | {"noise_ug": noise})
            for row in rows
        ]
