"""`python -m standin`: the stand-in as a separate process."""

from __future__ import annotations

import shlex
import threading
from dataclasses import fields
from typing import Any

import click

from .backends import DEFAULT_BACKENDS
from .settings import Settings
from .stand_in import StandIn


@click.command()
@click.option("--port", default=0, help="0 takes a free port.")
@click.option(
    "--backend",
    "backends",
    multiple=True,
    metavar="NAME=FAKE",
    help="A machine and the fake whose data it has; the usual ones where none is given.",
)
def main(port: int, backends: tuple[str, ...], **changes: Any) -> None:
    """Serve on 127.0.0.1 until interrupted, after the export lines that point a client at it."""
    machines = dict(pair.split("=", 1) for pair in backends) or DEFAULT_BACKENDS
    with StandIn(machines, port=port, settings=Settings(**changes)) as stand_in:
        for name, value in stand_in.environment().items():
            click.echo(f"export {name}={shlex.quote(value)}")
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            click.echo("stopped", err=True)


for field in reversed(fields(Settings)):
    option = f"--{field.name.replace('_', '-')}"
    main = click.option(option, default=field.default, show_default=True)(main)

if __name__ == "__main__":
    main()
