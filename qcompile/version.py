"""The version of qcompile, and those of the packages that results depend on."""

from __future__ import annotations

__version__ = "0.1.0"


def versions(*packages: str) -> dict[str, str]:
    """The version of qcompile and of each of `packages`, "none" where one is not installed."""
    return {"qcompile": __version__} | {package: _version(package) for package in packages}


def _version(package: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # a third of the time of --help

    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
