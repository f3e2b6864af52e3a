"""Whether today's commands make the shipped policies: `python benchmarks/shipped.py`.

Reads the commands from the cards in trained/README.md, runs each, and compares every number of the
policy with that of the shipped files. With --scores it prints the table of the cards instead. Bit
for bit holds on the machine and with the versions that the cards name; elsewhere the last digits
of a training may differ.
"""

from __future__ import annotations

import argparse
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np

import qcompile
from qcompile.cli.group import cli
from qcompile.policy import Policy

TRAINED = Path(__file__).parents[1] / "trained"
SHOWN = ("lunarlander", "acrobot", "cartpole", "cartpole_1q")
EPISODES, FIRST_SEED = 100, 10_000
_COMMAND = re.compile(r"^qcompile (train .*)$", re.MULTILINE)

COLUMNS = {
    "exact": {"shots": "exact"},
    "exact, greedy": {"shots": "exact", "greedy": True},
    "ibm_lima, 1024": {"backend": "ibm_lima", "shots": 1024},
    "ibm_lima, 8192": {"backend": "ibm_lima", "shots": 8192},
    "ibm_lima, 8192, no mitigation": {"backend": "ibm_lima", "shots": 8192, "mitigation": "none"},
}


def commands() -> Iterator[tuple[str, list[str]]]:
    """The name of each shipped policy and the arguments that train it, as the cards have them."""
    for line in _COMMAND.findall((TRAINED / "README.md").read_text()):
        arguments = shlex.split(line)
        yield Path(arguments[arguments.index("--out") + 1]).stem, arguments


def differing(left: Policy, right: Policy) -> list[str]:
    """The parts of two policies that are not the same to the last bit."""
    arrays = {
        name: (getattr(left, name), getattr(right, name)) for name in ("theta", "weights", "bias")
    }
    for name in ("feature", "scale", "gains"):
        arrays[name] = getattr(left.encoder, name), getattr(right.encoder, name)
    found = [name for name, pair in arrays.items() if not np.array_equal(*pair)]
    plain = ("environment", "program", "environment_kwargs")
    found += [name for name in plain if getattr(left, name) != getattr(right, name)]
    if left.encoder.functions != right.encoder.functions:
        found.append("functions")
    return found


def remake(names: set[str]) -> bool:
    """Train every policy of `names`, all where it is empty, and say whether each is the shipped."""
    same = True
    with tempfile.TemporaryDirectory() as folder:
        for name, arguments in commands():
            if names and name not in names:
                continue
            out = Path(folder) / f"{name}.pt"
            arguments[arguments.index("--out") + 1] = str(out)
            cli.main(arguments, standalone_mode=False)
            made = qcompile.load_policy(out)
            for shipped in (TRAINED / f"{name}.pt", TRAINED / f"{name}.json"):
                parts = differing(made, qcompile.load_policy(shipped))
                same = same and not parts
                words = f"differs in {', '.join(parts)}" if parts else "the same"
                click.echo(f"{shipped.name}: {words}")
    return same


def scores() -> None:
    """The table of the cards: mean ± standard deviation over the same episodes."""
    click.echo(f"| policy | circuits | trained numbers | {' | '.join(COLUMNS)} |")
    click.echo("|---|---|---|" + "---|" * len(COLUMNS))
    for name in SHOWN:
        policy = qcompile.load_policy(TRAINED / f"{name}.pt")
        cells = [name, str(len(policy.program)), str(policy.parameter_count)]
        for arguments in COLUMNS.values():
            result = qcompile.run(
                policy, episodes=EPISODES, seed=FIRST_SEED, progress=False, **arguments
            )
            cells.append(f"{np.mean(result.rewards):.1f} ± {np.std(result.rewards):.1f}")
        click.echo(f"| {' | '.join(cells)} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scores", action="store_true", help="print the table of the cards")
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these policies")
    chosen = parser.parse_args()
    if chosen.scores:
        scores()
    elif not remake(set(chosen.names)):
        sys.exit(1)


if __name__ == "__main__":
    main()
