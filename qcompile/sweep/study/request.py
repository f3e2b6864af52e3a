"""The request for a study: what is trained, and where it is written."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import fspath
from pathlib import Path
from typing import Any

from qcompile.caller import option
from qcompile.clashes import Named, check_clashes
from qcompile.deploy.registration import import_modules, module_path
from qcompile.device import backend_path
from qcompile.errors import StudyError
from qcompile.policy.arguments import check_env
from qcompile.sweep.arguments import Name, several
from qcompile.sweep.study.cell import EVALUATION_EPISODES, folder_of
from qcompile.sweep.study.rows import Cell, Row, Rows, cells
from qcompile.sweep.study.studies import default_folder, open_study


@dataclass(frozen=True, kw_only=True)
class StudyRequest:
    """The arguments of `qcompile.study` about what is trained, and where it is written."""

    name: Name = "paper"
    figures: str | Sequence[str] = ()
    rows: str | Sequence[str] = ()
    seeds: int | None = None
    episodes: int | None = None
    evaluation: int = EVALUATION_EPISODES
    imports: Name | Sequence[Name] = ()
    out: Name | None = None
    page: Name | None = None
    env: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def study(self) -> Rows:
        """The study itself.

        Raises:
            StudyError: there is no such study, or its file is not a study.
            EnvironmentMismatchError: a module cannot be imported.
        """
        import_modules(several(self.imports))
        check_env(self.env, for_file=True)
        return open_study(self.name)

    @property
    def folder(self) -> Path:
        """The folder of trainings, CSV and figures."""
        return default_folder(self.name) if self.out is None else Path(self.out)

    @property
    def page_path(self) -> Path:
        """The page."""
        return self.folder / "reproduction.md" if self.page is None else Path(self.page)

    @property
    def command(self) -> str:
        """The command line for the same request."""
        evaluation = None if self.evaluation == EVALUATION_EPISODES else self.evaluation
        options = {
            "--figure": several(self.figures),
            "--row": several(self.rows),
            "--seeds": [self.seeds],
            "--episodes": [self.episodes],
            "--evaluation": [evaluation],
            "--import": several(self.imports),
            "--out": [self.out],
            "--page": [self.page],
            "--env": [f"{name}={json.dumps(value)}" for name, value in self.env.items()],
        }
        words = ["qcompile", "study", fspath(self.name)]
        for name, values in options.items():
            words += [w for v in values if v is not None for w in (name, str(v))]
        return shlex.join(words)

    def changed(self, rows: Sequence[Row]) -> list[Row]:
        """The rows with the requested episodes and environment arguments."""
        changed = (replace(row, arguments={**row.arguments, **self.env}) for row in rows)
        return [row.shortened(self.episodes) for row in changed]

    def chosen(self) -> list[Row]:
        """The requested rows.

        Raises:
            StudyError: there is no such study, figure or row.
        """
        chosen = self.study.chosen(several(self.figures), several(self.rows))
        return self.changed(chosen)

    def cells(self) -> list[Cell]:
        """The requested trainings.

        Raises:
            StudyError: there is no such study, figure or row.
        """
        return cells(self.chosen(), self.seeds)

    def left(self) -> list[dict[str, Any]]:
        """The requested rows: name, environment, number of seeds, and how many are left to train.

        Raises:
            StudyError: there is no such study, figure or row.
        """
        folder = folder_of(self.folder, self.evaluation)
        return [
            {
                "row": row.name,
                "environment": row.environment,
                "seeds": len(row.first_seeds(self.seeds)),
                "left": len(folder.missing(cells([row], self.seeds))),
            }
            for row in self.chosen()
        ]

    def check_clashes(self) -> None:
        """Check that no file of the study overwrites another one, or one that it reads.

        Raises:
            StudyError: there is no such study, figure or row.
            OptionError: two names are the same file.
        """
        folder, out = folder_of(self.folder, self.evaluation), option("out")
        backends = [backend_path(row.settings.backend) for row in self.study.rows]
        reads: Named = {
            "the study": Path(self.name),
            option("backend"): backends,
            option("imports"): [*map(module_path, several(self.imports))],
        }
        names = ("results.csv", "curves.csv", *(f"{name}.png" for name in self.study.figures))
        page = f"{self.page_path.name} of {out}" if self.page is None else option("page")
        writes: Named = {
            out: self.folder,
            f"a training in {out}": [folder.file(cell) for cell in self.cells()],
            **{f"{name} of {out}": self.folder / name for name in names},
            page: self.page_path,
        }
        check_clashes(reads, writes, folders=[out])

    def check_replaces_nothing(self) -> None:
        """Check that a shortened study does not overwrite trainings with other settings.

        Raises:
            StudyError: a cell to train already has a file.
        """
        if self.episodes is None and self.evaluation == EVALUATION_EPISODES:
            return
        folder = folder_of(self.folder, self.evaluation)
        stored = [cell for cell in folder.missing(self.cells()) if folder.file(cell).exists()]
        if stored:
            raise StudyError(
                f"{self.folder} has {len(stored)} of these trainings with other settings.",
                f"Write the shortened study to another folder, such as {option('out')} look.",
            )
