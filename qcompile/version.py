"""The version of qcompile and of the packages that results depend on."""

from __future__ import annotations

__version__ = "0.1.0"


def versions(*packages: str) -> dict[str, str]:
    """The version of qcompile and of each of `packages`; "none" for one that is not installed."""
    return {"qcompile": __version__} | {package: _version(package) for package in packages}


def _version(package: str) -> str:
    # imported here because it would take a third of the time of --help
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
